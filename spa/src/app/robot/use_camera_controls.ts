import { type RefObject, useEffect } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import type { BodyView } from '../../scene/figure/body_view.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { startWhenLoaded } from '../shell/late.tsx';

const CONTROLS = new LatePart(() =>
  Promise.all([import('./camera_controls.ts'), import('./body_selection.ts')]),
);

/** Attaches camera keys, double taps and insets while a body is shown; with a twin, also joint selection by tap.
 *  Their code is loaded with the body. */
export function useCameraControls(
  host: RefObject<HTMLElement | null>,
  view: BodyView | null,
  twin: RobotTwin | null = null,
): void {
  useEffect(() => {
    const element = host.current;
    if (view === null || element === null) return;
    return startWhenLoaded(
      CONTROLS.load().then(([{ attachCameraControls, bindInsets }, { bindSelection }]) => () => {
        const ends = [attachCameraControls(element, view), bindInsets(element, view)];
        if (twin !== null) ends.push(bindSelection(element, view, twin));
        return () => {
          for (const end of ends) end();
        };
      }),
    );
  }, [host, view, twin]);
}
