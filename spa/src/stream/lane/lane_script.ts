import { openEventStream } from './open_lane.ts';

/** The script that the worker loads. It is bundled separately, the way workers are, and such bundles export nothing. */
Object.assign(self, { lane: { openEventStream } });
