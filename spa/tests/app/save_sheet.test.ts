// @vitest-environment happy-dom
import { afterEach, beforeAll, describe, expect, it, vi } from 'vitest';
import { bytesWords } from '../../src/app/past/save/Outcome.tsx';
import { SaveSheet } from '../../src/app/past/save/SaveSheet.tsx';
import {
  choicesOf,
  customSpan,
  fieldOf,
  fieldsOf,
  offerOf,
  spanOf,
} from '../../src/app/past/save/span_choice.ts';
import { saveEn } from '../../src/app/text/late_en.ts';
import { PastError } from '../../src/past/past_source.ts';
import type { Playhead } from '../../src/past/past_types.ts';
import { mount, unmount } from '../rigs/mounted.ts';
import { FakePast, timelineOf } from '../rigs/past_fake.ts';
import { FakeSource } from '../rigs/past_player_rig.ts';
import { FROM_MS, recorded, sent } from '../rigs/past_recordings.ts';

const NO_MODEL = () => 'http://127.0.0.1:9/manifest.json';
const NOW_MS = FROM_MS + 600_000;

describe('what is offered', () => {
  it('is the last minutes up to now, and in the past up to the shown moment', () => {
    const past = new FakePast(NOW_MS);
    expect(spanOf(offerOf(past), '1')).toEqual({ fromMs: NOW_MS - 60_000, toMs: NOW_MS });
    past.rest(120);
    const momentMs = NOW_MS - 120_000;
    expect(spanOf(offerOf(past), '5')).toEqual({ fromMs: momentMs - 300_000, toMs: momentMs });
    expect(choicesOf(offerOf(past))).toEqual(['1', '5', '10', 'custom']);
  });

  it('is no more than there is', () => {
    const past = new FakePast(NOW_MS, timelineOf(NOW_MS, 2));
    expect(spanOf(offerOf(past), '10').fromMs).toBe(NOW_MS - 120_000);
  });

  it('is all of a short recording, and of a long one the minutes from the shown moment on', () => {
    const recorded = { fromMs: 0, toMs: NOW_MS } as Playhead['recorded'];
    const short = new FakePast(NOW_MS, timelineOf(NOW_MS, 3));
    short.set({ at: 'past', playing: false, momentMs: NOW_MS - 180_000, recorded });
    expect(choicesOf(offerOf(short))).toEqual(['all', 'custom']);
    expect(spanOf(offerOf(short), 'all')).toEqual({ fromMs: NOW_MS - 180_000, toMs: NOW_MS });
    const long = new FakePast(NOW_MS, timelineOf(NOW_MS, 50));
    const momentMs = NOW_MS - 50 * 60_000;
    long.set({ at: 'past', playing: false, momentMs, recorded });
    expect(choicesOf(offerOf(long))).toEqual(['1', '5', '10', 'custom']);
    expect(spanOf(offerOf(long), '5')).toEqual({ fromMs: momentMs, toMs: momentMs + 300_000 });
    long.set({ momentMs: NOW_MS });
    expect(spanOf(offerOf(long), '5')).toEqual({ fromMs: NOW_MS - 300_000, toMs: NOW_MS });
  });

  it('is what is repeated, first of all', () => {
    const past = new FakePast(NOW_MS);
    const loop = { fromMs: NOW_MS - 9000, toMs: NOW_MS - 4000 };
    past.set({ at: 'past', loop });
    expect(choicesOf(offerOf(past))[0]).toBe('loop');
    expect(spanOf(offerOf(past), 'loop')).toEqual(loop);
  });

  it('is from one moment to another, in whole seconds', () => {
    const fields = fieldsOf(offerOf(new FakePast(NOW_MS + 250)));
    expect(customSpan(fields)).toEqual({ fromMs: NOW_MS - 60_000, toMs: NOW_MS });
    expect(fieldOf(NOW_MS + 999)).toBe(fieldOf(NOW_MS));
    expect(customSpan({ from: fields.to, to: fields.from })).toBeNull();
    expect(customSpan({ from: '', to: fields.to })).toBeNull();
  });
});

it('says how large a file is', () => {
  expect([0, 840, 12_345, 999_600, 3_440_000, 120e6, 2.5e9].map(bytesWords)).toEqual([
    ...['0.1 kB', '0.8 kB', '12 kB', '1.0 MB', '3.4 MB', '120 MB', '2.5 GB'],
  ]);
});

describe('the sheet', () => {
  const saved: { name: string; blob: Blob }[] = [];
  const blobs = new Map<string, Blob>();

  beforeAll(() => {
    HTMLDialogElement.prototype.showModal ??= function () {
      this.open = true;
    };
    vi.spyOn(URL, 'createObjectURL').mockImplementation((blob) => {
      blobs.set(`blob:${blobs.size}`, blob as Blob);
      return `blob:${blobs.size - 1}`;
    });
    vi.spyOn(HTMLAnchorElement.prototype, 'click').mockImplementation(function (this: HTMLAnchorElement) {
      saved.push({ name: this.download, blob: blobs.get(this.getAttribute('href')!)! });
    });
  });

  afterEach(() => {
    saved.length = 0;
  });

  function open(source: FakeSource) {
    const controls = new FakePast(FROM_MS + 20_000);
    const { host, says: hostSays } = mount(SaveSheet, {
      ...{ controls, source, manifestUrl: NO_MODEL, onClose: () => {} },
    });
    const find = <E extends HTMLElement>(testId: string) =>
      host.querySelector<E>(`[data-testid="${testId}"]`) ?? null;
    const says = (testId: string, words: string | RegExp) => hostSays(`[data-testid="${testId}"]`, words);
    const ready = () =>
      vi.waitFor(() => expect(find<HTMLButtonElement>('save-go')?.disabled).toBe(false), 5000);
    return { find, says, ready };
  }

  it('measures, saves and says so', async () => {
    const { find, says, ready } = open(new FakeSource(recorded(sent(150))));
    await says('save-measure', /150 frames, about \d/);
    await says('save-until', 'Saves up to');
    await ready();
    find('save-go')!.click();
    await says('save-outcome', /^Saved: r_2025-11-2\d_[\d-]+\.csv, \d/);
    expect(saved.map(({ name }) => name)).toEqual([expect.stringMatching(/^r_.*\.csv$/)]);
    expect((await saved[0]!.blob.text()).split('\r\n').length).toBe(152);
    find('save-posecast')!.click();
    await vi.waitFor(() => expect(find('save-outcome')!.dataset.at).toBe('rest'));
  });

  it('says what a file lacks', async () => {
    const source = new FakeSource(recorded(sent(150)));
    const { find, says, ready } = open(source);
    await ready();
    source.answer = async ({ index }) => {
      if (index === 2) throw new PastError('gone', 'not kept');
    };
    find('save-go')!.click();
    await says('save-outcome', 'The file lacks');
  });

  it('says that nothing is there, and that nobody answers', async () => {
    const { find, says } = open(new FakeSource([]));
    await says('save-measure', saveEn.nothing);
    expect(find<HTMLButtonElement>('save-go')!.disabled).toBe(true);
    unmount();
    const away = new FakeSource(recorded(sent(30)));
    away.isAway = true;
    await open(away).says('save-measure', saveEn.away);
  });

  it('stops when it is told to', async () => {
    const source = new FakeSource(recorded(sent(150)));
    const { find, ready } = open(source);
    await ready();
    source.answer = () => new Promise(() => {}); // for ever
    find('save-go')!.click();
    await vi.waitFor(() => expect(find('save-progress')).not.toBeNull());
    find('save-cancel')!.click();
    await vi.waitFor(() => expect(find('save-go')).not.toBeNull());
    expect(saved).toEqual([]);
  });
});
