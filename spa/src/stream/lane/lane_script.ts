import { openEventStream } from './open_lane.ts';

/** The script that the worker loads. It is bundled by itself as another worker's would be, and those export nothing. */
Object.assign(self, { lane: { openEventStream } });
