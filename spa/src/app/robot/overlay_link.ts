import '../shell/styles/signs.css';
import type { OverlaidBody } from '../../scene/figure/body_view.ts';
import { isOld } from '../../twin/liveness.ts';
import { isolated, wordsOfName } from '../../twin/names.ts';
import { OverlayReader } from '../../twin/overlay/reader.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { LoadScale } from '../../twin/sensors/load.ts';
import { BALANCE } from '../balance/BalanceParts.tsx';
import type { RobotLink } from '../state/robot_link.ts';
import { onSelection, selection } from '../state/selection.ts';
import { onSettings, settings } from '../state/settings.ts';
import { languageTag, onLanguage } from '../text/language.ts';
import { more } from '../text/more.ts';
import type { More } from '../text/more_en.ts';

/** A running connection between the readings of a robot and the overlay of its body. */
export interface OverlayLink {
  /** The scale of the load colours; null while they are off or there is no frame yet. */
  loadScale(): LoadScale | null;
  /** Stops drawing the overlay. */
  stop(): void;
}

/** The texts of the signs, and the inputs they were made from. */
interface Words {
  readonly words: More;
  readonly madeOf: readonly unknown[];
}

/** The texts of the signs, with joint names in plain words if the viewer wants them. `before`: those of the last frame. */
function wordsFor({ schema }: RobotTwin, plain: boolean, before: Words | null): Words {
  const text = more();
  const madeOf = [schema, text, plain];
  if (before?.madeOf.every((part, i) => part === madeOf[i])) return before;
  if (!plain) return { words: text, madeOf };
  const named = (channel: string) => {
    const words = wordsOfName(schema, channel, languageTag());
    return words === null ? channel : isolated(words);
  };
  const words = {
    ...text,
    offBy: (channel: string, by: string) => text.offBy(named(channel), by),
    compliant: (channel: string) => text.compliant(named(channel)),
  };
  return { words, madeOf };
}

/** Draws the overlay of a body from each new frame, outside React. It follows settings and language. */
export function bindOverlay(scene: OverlaidBody, { twin, watch }: RobotLink): OverlayLink {
  let reader: OverlayReader | null = null;
  let ghostShown = false;
  let words: Words | null = null;

  const follow = () => {
    const { schema, state, limits } = twin;
    if (schema === null || state === null || limits === null) {
      scene.showSigns(null);
      if (ghostShown) scene.showGhost(null);
      ghostShown = false;
      return;
    }
    if (reader?.schema !== schema) reader = new OverlayReader(schema);
    const choice = { ...settings(), joint: selection()?.joint ?? null };
    const read = reader.read(state.codes, limits, choice);
    const isMeasured = choice.shown !== 'ref' || !reader.can.lens; // the states that lead up to a moment have no commands
    const lead = twin.lead === null || !isMeasured ? null : { states: twin.lead, tS: state.tS };
    const readings = { ...read, balance: read.balance && { ...read.balance, lead } };
    const ghost = reader.ghost(readings, choice);
    scene.lockHeading(choice.headingLocked);
    if (ghost !== null) scene.showGhost(ghost.joints, ghost.limbs);
    else if (ghostShown) scene.showGhost(null);
    ghostShown = ghost !== null;
    const { arrowScale, palette, angle, shown, names } = choice;
    words = wordsFor(twin, names === 'words', words);
    const from = shown === 'ref' && reader.can.lens ? 'ref' : 'pos';
    const live = !isOld(watch.verdict());
    if (readings.balance !== null) BALANCE.load();
    const part = BALANCE.value();
    const balance = part?.makeBalance ?? null;
    scene.showSigns(readings, { from, live, arrowScale, palette, angle, words: words.words, balance });
  };

  const leave = [
    twin.onState(follow),
    twin.onChange(follow),
    onSettings(follow),
    onLanguage(follow),
    watch.onWord(follow),
    onSelection(follow),
    BALANCE.subscribe(follow),
  ];
  follow();
  return {
    loadScale: () => {
      const { limits } = twin;
      return limits === null ? null : (reader?.loadScale(limits, settings().load) ?? null);
    },
    stop: () => {
      for (const off of leave) off();
    },
  };
}
