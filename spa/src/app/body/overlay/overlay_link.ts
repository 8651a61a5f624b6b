import '../../styles/signs.css';
import { OverlayReader } from '../../../twin/overlay/reader.ts';
import type { LoadScale } from '../../../twin/sensors/load.ts';
import type { OverlaidBody } from '../../../view/body_view.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { onSettings, settings } from '../../state/settings.ts';
import { onLanguage } from '../../text/language.ts';
import { more } from '../../text/more.ts';

/** A running connection between the readings of a robot and the overlay of its body. */
export interface OverlayLink {
  /** The scale of the load colours; null while they are off or there is no frame yet. */
  loadScale(): LoadScale | null;
  /** Stops drawing the overlay. */
  stop(): void;
}

/** Draws the overlay of a body from each new frame, outside React. It follows settings and language. */
export function bindOverlay(scene: OverlaidBody, { twin, watch }: RobotLink): OverlayLink {
  let reader: OverlayReader | null = null;
  let ghostShown = false;

  const follow = () => {
    const { schema, state, limits } = twin;
    if (schema === null || state === null || limits === null) {
      scene.showSigns(null);
      if (ghostShown) scene.showGhost(null);
      ghostShown = false;
      return;
    }
    if (reader?.schema !== schema) reader = new OverlayReader(schema);
    const choice = settings();
    const readings = reader.read(state.codes, limits, choice);
    const ghost = reader.ghost(readings, choice);
    scene.lockHeading(choice.headingLocked);
    if (ghost !== null) scene.showGhost(ghost, [...ghost.keys()]);
    else if (ghostShown) scene.showGhost(null);
    ghostShown = ghost !== null;
    const { arrowScale, palette, angle, shown } = choice;
    const from = shown === 'ref' && reader.can.lens ? 'ref' : 'pos';
    const live = watch.word === 'LIVE' || watch.word === 'HOLDING';
    scene.showSigns(readings, { from, live, arrowScale, palette, angle, words: more() });
  };

  const leave = [
    twin.onState(follow),
    twin.onChange(follow),
    onSettings(follow),
    onLanguage(follow),
    watch.onWord(follow),
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
