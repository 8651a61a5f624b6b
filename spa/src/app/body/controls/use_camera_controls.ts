import { type RefObject, useEffect } from 'react';
import type { RobotTwin } from '../../../twin/robot.ts';
import type { BodyView } from '../../../view/body_view.ts';
import { follow } from '../../shell/deferred_start.ts';

/** Keys, double taps and the chosen mouse, as long as a body is shown, and room for it among what stands over it; with a twin,
 *  its joints are chosen by a tap. The code of all of them comes with the body. */
export function useCameraHands(
  host: RefObject<HTMLElement | null>,
  view: BodyView | null,
  twin: RobotTwin | null = null,
): void {
  useEffect(() => {
    const element = host.current;
    if (view === null || element === null) return;
    return follow(
      import('./index.ts').then((hands) => () => {
        const ends = [hands.giveHands(element, view), hands.coverFollows(element, view)];
        if (twin !== null) ends.push(hands.selectionFollows(element, view, twin));
        return () => {
          for (const end of ends) end();
        };
      }),
    );
  }, [host, view, twin]);
}
