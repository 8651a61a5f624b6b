import { execFileSync } from 'node:child_process';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { is, RECORD, shownPositions } from './robot_page.ts';
import { PYTHON, REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

interface Stored {
  readonly seq: number;
  readonly pos: Readonly<Record<string, number | null>>;
}

function stored(url: string): Stored {
  const output = execFileSync(PYTHON, [path.join(REPO, 'spa/e2e/stored.py'), url, 'demo']);
  return JSON.parse(output.toString()) as Stored;
}

describe('a real Redis', () => {
  it('holds the newest state, the one that viewers see', async () => {
    const url = await stage.stack.redis();
    const relay = await stage.stack.relay({ store: url });
    const tap = stage.stack.tap(relay);
    const edge = stage.stack.edge(relay);
    const page = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD });
    await until('LIVE', is(page, 'LIVE', 'HOLDING'));
    await until('frames', async () => (await shownPositions(page)).size > 10);

    await edge.kill();
    const newest = await until('the last frame has come to rest', async () => {
      const shown = Math.max(...(await shownPositions(page)).keys());
      const last = stored(url);
      return shown === last.seq && tap.frame(last.seq) !== undefined ? last : null;
    });
    expect(newest.seq).toBe(tap.newest?.seq);
    expect(newest.pos).toEqual(tap.frame(newest.seq)?.values.pos);
  });
});
