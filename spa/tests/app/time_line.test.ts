// @vitest-environment happy-dom
import { createElement } from 'react';
import { beforeAll, beforeEach, describe, expect, it, vi } from 'vitest';
import { chooseOn, chosenOn, pastKeys } from '../../src/app/past/time_line/line.ts';
import { TimeLine } from '../../src/app/past/time_line/TimeLine.tsx';
import { usePageKeys } from '../../src/app/shell/page_keys.ts';
import { nowMs } from '../../src/stream/clock.ts';
import { mount, unmount } from '../rigs/mounted.ts';
import { FakePast, timelineOf } from '../rigs/past_fake.ts';

/** A track of ten minutes, on which a pixel is about a second. */
const WIDTH_PX = 614;
let frames: (() => void)[] = [];

beforeAll(() => {
  const box = { left: 0, top: 0, right: WIDTH_PX, bottom: 34, width: WIDTH_PX, height: 34 };
  vi.spyOn(HTMLElement.prototype, 'getBoundingClientRect').mockReturnValue(box as DOMRect);
  HTMLElement.prototype.setPointerCapture = () => {};
  vi.stubGlobal('requestAnimationFrame', (run: () => void) => frames.push(run));
  vi.stubGlobal('cancelAnimationFrame', () => {});
});

beforeEach(() => {
  frames = [];
});

function Page({ past }: { past: FakePast }) {
  usePageKeys(() => pastKeys(past, null));
  return createElement(TimeLine, { controls: past });
}

/** The time line of a robot with ten minutes of past. */
async function timeLine(past = new FakePast(nowMs())) {
  const { host, findById: find } = mount(Page, { past });
  const gone = (testId: string) =>
    vi.waitFor(() => expect(host.querySelector(`[data-testid="${testId}"]`)).toBeNull());
  const named = (name: string) => host.querySelector<HTMLElement>(`[aria-label^="${name}"]`)!;
  return { past, host, find, gone, named };
}

const pointer = (to: Element, type: string, clientX: number, more: PointerEventInit = {}) =>
  to.dispatchEvent(
    new PointerEvent(type, { bubbles: true, pointerId: 1, button: 0, clientX, clientY: 10, ...more }),
  );
const key = (to: EventTarget, name: string, more: KeyboardEventInit = {}) => {
  const event = new KeyboardEvent('keydown', { key: name, bubbles: true, cancelable: true, ...more });
  to.dispatchEvent(event);
  return event.defaultPrevented;
};

describe('the time line', () => {
  it('is not there where there is no past', async () => {
    const { host, past, find } = await timeLine(new FakePast(nowMs(), null));
    expect(host.textContent).toBe('');
    past.timeline = timelineOf(nowMs());
    past.set({});
    await find('track');
  });

  it('is slim while live, and opens in the past', async () => {
    const { past, find, gone } = await timeLine();
    const track = await find('track');
    expect((await find('time-line')).dataset.open).toBe('false');
    expect(track.getAttribute('aria-valuetext')).toBe('Live');
    await gone('playhead');
    past.rest(120);
    await find('transport');
    expect((await find('to-live')).getAttribute('aria-pressed')).toBe('false');
    await vi.waitFor(() => expect(track.getAttribute('aria-valuetext')).toMatch(/:\d\d, 2 min ago, paused$/));
    expect(track.getAttribute('aria-valuenow')).toBe('-120');
    expect((await find('playhead')).style.transform).toMatch(/translateX\(4\d\d/);
    (await find('to-live')).click();
    await gone('transport');
    expect(past.told).toEqual(['live']);
  });

  it('does not move under a finger: it opens once that is up', async () => {
    const { past, find, gone } = await timeLine();
    const track = await find('track');
    pointer(track, 'pointerdown', 307);
    await find('playhead');
    await gone('transport');
    pointer(track, 'pointermove', 250);
    pointer(track, 'pointermove', 207);
    for (const frame of frames.splice(0)) frame();
    pointer(track, 'pointermove', 150, { pointerId: 2 });
    pointer(track, 'pointerup', 207);
    await find('transport');
    expect(past.told).toHaveLength(4);
    expect(past.told[0]).toBe('attend');
    expect(past.told[1]).toMatch(/^scrub (299|30\d)/);
    expect(past.told[2]).toMatch(/^scrub (399|40\d)/);
    expect(past.told[3]).toBe('settle');
  });

  it('settles when the system takes the pointer, or the line, away', async () => {
    const { past, find } = await timeLine();
    const track = await find('track');
    pointer(track, 'pointerdown', 307);
    pointer(track, 'pointercancel', 307);
    expect(past.told.at(-1)).toBe('settle');
    pointer(track, 'pointerdown', 207);
    expect(past.told.at(-1)).toMatch(/^scrub/);
    unmount();
    await vi.waitFor(() => expect(past.told.at(-1)).toBe('settle'));
  });

  it('leaves other buttons of the mouse alone', async () => {
    const { past, find } = await timeLine();
    pointer(await find('track'), 'pointerdown', 307, { button: 2 });
    expect(past.told).toEqual([]);
  });

  it('tells what is under the pointer', async () => {
    const now = nowMs();
    const past = new FakePast(now, timelineOf(now, 10, [{ atMs: now - 300_000 }]));
    const { find, gone } = await timeLine(past);
    const track = await find('track');
    pointer(track, 'pointermove', 307);
    await vi.waitFor(async () => expect((await find('tip')).textContent).toMatch(/5 min ago.*RKN.*jam/));
    expect(past.told).toEqual([]);
    pointer(track, 'pointerout', 307, { relatedTarget: document.body });
    await gone('tip');
  });

  it('plays, skips, steps and loops by its buttons', async () => {
    const { past, find, named } = await timeLine();
    past.rest(120);
    await find('transport');
    for (const name of ['Back 10 s', 'Forward 10 s', 'One frame back', 'One frame forward', 'Play'])
      named(name).click();
    expect(past.told).toEqual(['skip -10000', 'skip 10000', 'step -1', 'step 1', 'toggle']);
    await vi.waitFor(() => expect(named('Pause')).not.toBeNull());
    expect(named('Previous fault').hasAttribute('disabled')).toBe(true); // there is none
    const loop = await find('loop-button');
    loop.click();
    await vi.waitFor(() => expect(loop.dataset.state).toBe('started'));
    past.rest(60);
    loop.click();
    await vi.waitFor(() => expect(loop.dataset.state).toBe('on'));
    await find('loop');
    loop.click();
    expect(past.told.slice(5)).toEqual(['loop 120 to 60', 'no loop']);
  });

  it('sets the speed in either form of the choice', async () => {
    const { past, host, find } = await timeLine();
    past.rest(120);
    await find('transport');
    host.querySelector<HTMLInputElement>('input[type=radio]')!.click();
    await vi.waitFor(() => expect(host.querySelector('select')?.value).toBe('0.25'));
    expect(past.told).toEqual(['speed 0.25']);
  });

  it('offers a shorter range where there is more', async () => {
    const { past, find, gone } = await timeLine();
    past.rest(120);
    const range = await find('range');
    expect(range.textContent).toBe('5 min10 min');
    const track = await find('track');
    const place = () => track.querySelector<HTMLElement>('[data-testid=playhead]')?.style.transform;
    const before = place();
    range.click();
    await vi.waitFor(() => expect(place()).not.toBe(before));
    expect(range.getAttribute('aria-label')).toBe('Show the last 10 min');
    past.timeline = timelineOf(nowMs(), 5);
    past.set({});
    await gone('range');
  });

  it('has times at rest, and says what it looks at', async () => {
    const { past, host } = await timeLine();
    await vi.waitFor(() =>
      expect(host.querySelectorAll('.track-ticks text').length, 'live, and slim').toBeGreaterThan(2),
    );
    const labels = [...host.querySelectorAll('.track-ticks text')].map(({ textContent }) => textContent);
    for (const label of labels) expect(label).toMatch(/^\d\d:\d\d$|^\d+ [A-Z]/);
    expect(past.looked.at(-1)!.toMs - past.looked.at(-1)!.fromMs).toBeGreaterThanOrEqual(600_000);
  });

  it('has several scales where there is a long past, by list, button, key and wheel', async () => {
    const now = nowMs();
    const past = new FakePast(now, timelineOf(now, 31 * 1440));
    const { find } = await timeLine(past);
    past.rest(120);
    const list = (await find('scale')) as HTMLSelectElement;
    const shown = () => Number(list.value) / 60_000;
    const looked = () => Math.round((past.looked.at(-1)!.toMs - past.looked.at(-1)!.fromMs) / 60_000);
    expect([...list.options].map(({ text }) => text)).toEqual(['5 min', '30 min', '3 h', '24 h', '7 days']);
    expect(shown(), 'hours by itself').toBe(180);
    const track = await find('track');
    expect(key(track, '-')).toBe(true);
    await vi.waitFor(() => expect([shown(), looked()]).toEqual([1440, 1440]));
    document.querySelector<HTMLElement>('.scale-step')!.click();
    await vi.waitFor(() => expect([shown(), looked()]).toEqual([10_080, 10_080]));
    for (const minutes of [1440, 180, 30]) {
      key(track, '+');
      await vi.waitFor(() => expect([shown(), looked()]).toEqual([minutes, minutes]));
    }
    const wheel = new WheelEvent('wheel', { deltaY: 100, bubbles: true, cancelable: true });
    track.dispatchEvent(wheel);
    expect(wheel.defaultPrevented, 'the page does not scroll by it').toBe(true);
    await vi.waitFor(() => expect(shown()).toBe(180));
    expect(key(document.body, '+'), 'it is the camera’s').toBe(false);
    past.told.length = 0;
    key(track, 'ArrowLeft');
    expect(past.told).toEqual(['seek 130']);
    past.rest(2 * 86_400);
    const { fromMs, toMs } = await vi.waitFor(() => {
      const span = past.looked.at(-1)!;
      expect(span.toMs).toBeLessThan(now - 86_400_000);
      return span;
    });
    const { momentMs } = past.playhead;
    expect(momentMs > fromMs && momentMs < toMs, 'the playhead stays in sight').toBe(true);
  });

  it('has another scale by two fingers, which leave the moment as it was', async () => {
    const now = nowMs();
    const past = new FakePast(now, timelineOf(now, 31 * 1440));
    const { find } = await timeLine(past);
    past.rest(120);
    const list = (await find('scale')) as HTMLSelectElement;
    const track = await find('track');
    const before = past.playhead.momentMs;
    const touch = (type: string, pointerId: number, clientX: number) =>
      pointer(track, type, clientX, { pointerId, pointerType: 'touch' });
    touch('pointerdown', 1, 200);
    touch('pointerdown', 2, 300);
    expect(past.playhead.momentMs).toBe(before);
    touch('pointermove', 2, 400);
    await vi.waitFor(() => expect(list.value).toBe('1800000'));
    touch('pointermove', 2, 230);
    await vi.waitFor(() => expect(list.value).toBe('10800000'));
    touch('pointerup', 1, 200);
    touch('pointerup', 2, 230);
    expect(past.playhead.momentMs).toBe(before);
    touch('pointerdown', 3, 200);
    expect(past.told.at(-1), 'one finger drags again').toMatch(/^scrub/);
    touch('pointerup', 3, 200);
  });

  it('goes to a finer scale for a span that would be too narrow, and never draws one unseen', async () => {
    const now = nowMs();
    const past = new FakePast(now, timelineOf(now, 31 * 1440));
    const { find } = await timeLine(past);
    past.rest(120);
    const list = (await find('scale')) as HTMLSelectElement;
    past.set({ loop: { fromMs: now - 122_000, toMs: now - 120_000 } });
    await vi.waitFor(() => expect(list.value).toBe('300000'));
    const rect = (await find('loop')).querySelector('rect')!;
    expect(Number(rect.getAttribute('width'))).toBeGreaterThanOrEqual(12);
  });

  it('opens the sheet of moments by its button, by the clock and by G', async () => {
    const { past, find, host } = await timeLine();
    past.rest(120);
    await find('transport');
    const jump = await find('jump');
    const clock = host.querySelector<HTMLElement>('.transport-moment')!;
    for (const ask of [() => jump.click(), () => clock.click(), () => key(document.body, 'g')]) {
      ask();
      expect(chosenOn(past).get().isJumpOpen).toBe(true);
      chooseOn(past, { isJumpOpen: false });
    }
  });

  it('has hundredths at the playhead where it rests, also where a phone shows nothing else', async () => {
    const { past, find } = await timeLine();
    past.rest(300);
    const head = await find('playhead');
    await vi.waitFor(() => expect(head.textContent).toMatch(/:\d\d\.\d\d$/));
    past.set({ playing: true });
    await vi.waitFor(() => expect(head.textContent).toMatch(/^\d\d:\d\d:\d\d$/));
  });

  it('keeps the playhead’s time on the track, however wide the font makes it', async () => {
    const { past, find } = await timeLine();
    past.rest(1);
    const head = await find('playhead');
    const time = await vi.waitFor(() => head.querySelector('time')!);
    const [, headPx] = /translateX\((\d+\.?\d*)px/.exec(head.style.transform)!;
    const limits = /^translateX\(clamp\(-([\d.]+)px, -50%, ([\d.]+)px - 100%\)\)$/.exec(
      time.style.transform,
    )!;
    const [leftPx, rightPx] = limits.slice(1).map(Number);
    expect(leftPx).toBeCloseTo(Number(headPx), 3);
    expect(leftPx! + rightPx!).toBeCloseTo(
      (await find('track')).parentElement!.getBoundingClientRect().width,
      0,
    );
  });

  it('End takes away what the resting mouse had shown; beside the playhead’s time that makes room', async () => {
    const { past, find, gone } = await timeLine();
    past.rest(300);
    const track = await find('track');
    pointer(track, 'pointermove', 307);
    const { transform, left } = (await find('tip')).style;
    expect(left).toBe('50%');
    expect(transform).toMatch(/^translateX\((max|min)\(-50%, /);
    key(track, 'End');
    await gone('tip');
  });

  it('says what has to be told, and loading only quietly', async () => {
    const { past, find, gone } = await timeLine();
    past.rest(120);
    past.set({ note: 'not-kept', askedMs: Date.UTC(2026, 10, 22, 14, 2) });
    const note = await find('past-note');
    expect(note.getAttribute('role')).toBe('status');
    expect(note.textContent).toMatch(
      /^22 Nov (2026 )?\d\d:\d\d:00 is no longer kept; this is the oldest moment, .*\.$/,
    );
    past.set({ note: 'not-come' });
    await vi.waitFor(() => expect(note.textContent).toMatch(/^22 Nov .* is in the future\. This is live\.$/));
    past.set({ note: 'loading' });
    await gone('past-note');
    expect((await find('playhead')).dataset.loading).toBe('true');
  });

  it('tells a screen reader of what somebody does, not of what plays', async () => {
    const { past, find } = await timeLine();
    past.rest(300);
    past.set({ playing: true });
    const track = await find('track');
    await vi.waitFor(() => expect(track.getAttribute('aria-valuetext')).toMatch(/playing at 1×/));
    const said = track.getAttribute('aria-valuetext');
    const place = (await find('playhead')).style.transform;
    past.set({ momentMs: past.playhead.momentMs + 690 });
    await vi.waitFor(async () => expect((await find('playhead')).style.transform).not.toBe(place));
    expect(track.getAttribute('aria-valuetext')).toBe(said);
    past.set({ momentMs: past.playhead.momentMs + 10_000 });
    await vi.waitFor(() => expect(track.getAttribute('aria-valuetext')).not.toBe(said));
  });
});
