import { expect, it } from 'vitest';
import { balanceEn } from '../../src/app/text/late_en.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { FILES } from '../../src/scene/signs/balance.ts';
import { limitChannels } from '../../src/twin/alarms/limit_channels.ts';
import { SCHEMA } from '../rigs/schema.ts';

it('what limits can be set for is forces and moments place by place, and load of all joints', () => {
  const groups = limitChannels(SCHEMA, moreEn);
  expect(groups.map(({ title, channels }) => [title, channels.map(({ label }) => label)])).toEqual([
    ['right foot', ['RF.fz', 'RF.mx', 'RF.my']],
    ['Power', ['main']],
    ['Motors', ['*', '*']],
  ]);
  expect(groups[0]?.channels[0]?.span, 'room beyond the limit').toBe(750);
  expect(limitChannels(FILES, moreEn, balanceEn)).toMatchObject([
    { title: 'Balance', channels: [{ field: 'balance', label: 'margin', unit: 'mm', span: 100 }] },
  ]);
  expect(limitChannels(FILES, moreEn)).toEqual([]);
});
