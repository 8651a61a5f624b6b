import { useEffect, useRef } from 'react';
import { type PastControls, SPEEDS } from '../../../past/past_types.ts';
import { momentSheet } from './jump/moment_sheet.ts';
import { pressLoop } from './loop_start.ts';
import { arrowMs, shownMs, stepScale } from './scale/scales.ts';

type Key = Pick<KeyboardEvent, 'key' | 'code' | 'repeat' | 'shiftKey'>;

/** Elements that handle Space themselves. A button or tab that was clicked is excluded: after a click, Space is meant for the
 *  page; after keyboard focus, it presses the element. */
const TAKES_SPACE = 'button, a, input, summary, [role="button"], [role="tab"], [role="separator"]';
const TYPED_INTO = 'input:not([type="radio"], [type="checkbox"]), textarea, select, [contenteditable]';

/** Handles a page-wide key; false if the past has no such key. */
export function playPastKey(controls: PastControls, event: Key, save: (() => void) | null = null): boolean {
  const { at, speed } = controls.playhead;
  const live = at === 'live';
  // With a Korean layout, the physical key decides.
  const key = /^[ -~]$/.test(event.key)
    ? event.key.toLowerCase()
    : event.code.replace('Key', '').toLowerCase();
  switch (key) {
    case ' ':
    case 'space':
      if (!event.repeat) controls.toggle();
      return true;
    case ',':
      controls.step(-1);
      return true;
    case '.':
      if (!live) controls.step(1);
      return true;
    case 'j':
      controls.skip(-10_000);
      return true;
    case 'l':
      if (!live) controls.skip(10_000);
      return true;
    case 'b':
      controls.visitFault(-1);
      return true;
    case 'n':
      if (!live) controls.visitFault(1);
      return true;
    case '[':
    case ']': {
      const next = SPEEDS[SPEEDS.indexOf(speed) + (key === ']' ? 1 : -1)];
      if (!live && next !== undefined) controls.setSpeed(next);
      return true;
    }
    case 'e':
      controls.goLive();
      return !live;
    case 'g':
      if (!event.repeat) momentSheet.set(controls);
      return true;
    case 'x':
      save?.();
      return save !== null;
    case 'o':
      if (!event.repeat && !live) pressLoop(controls);
      return true;
    default:
      return false;
  }
}

/** Handles a key while the time line has the focus; false if it has no such key. `nowMs`: the current time. */
export function playTrackKey(controls: PastControls, nowMs: number, { key, shiftKey }: Key): boolean {
  const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -60, PageUp: 60 }[key];
  if (by !== undefined) {
    const arrow = key.startsWith('Arrow');
    const { at, momentMs } = controls.playhead;
    const toMs = momentMs + by * (arrow && shiftKey ? 10 : 1) * arrowMs(shownMs(controls));
    if (toMs < nowMs) controls.seek(Math.max(toMs, controls.timeline?.fromMs ?? toMs));
    else if (at === 'past') controls.goLive();
    return true;
  }
  if (key === '+' || key === '=') stepScale(controls, -1);
  else if (key === '-') stepScale(controls, 1);
  else if (key === 'Home') controls.seek(controls.timeline?.fromMs ?? controls.playhead.momentMs);
  else if (key === 'End') controls.goLive();
  else return false;
  return true;
}

/** The past's page-wide keys, active unless the viewer is typing or a dialog is open. null: there is no past, or it can't be
 *  saved. */
export function usePastKeys(controls: PastControls | null, save: (() => void) | null = null): void {
  const saveNow = useRef(save);
  saveNow.current = save;
  useEffect(() => {
    if (controls === null) return;
    let clicked: Element | null = null;
    const takes = (target: EventTarget | null) =>
      target instanceof Element ? target.closest(TAKES_SPACE) : null;
    const onPointer = (event: PointerEvent) => {
      clicked = takes(event.target);
    };
    const onKey = (event: KeyboardEvent) => {
      if (event.key === 'Tab') clicked = null;
      if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
      const at = event.target instanceof Element ? event.target : document.body;
      if (at.closest(TYPED_INTO) !== null || document.querySelector('dialog[open]') !== null) return;
      const taker = takes(at);
      if (event.key === ' ' && taker !== null && (taker !== clicked || taker.matches('input'))) return;
      if (controls.timeline === null && controls.playhead.at === 'live') return;
      if (playPastKey(controls, event, saveNow.current)) event.preventDefault();
    };
    window.addEventListener('pointerdown', onPointer, true);
    window.addEventListener('keydown', onKey);
    return () => {
      window.removeEventListener('pointerdown', onPointer, true);
      window.removeEventListener('keydown', onKey);
    };
  }, [controls]);
}
