import type { ReactNode } from 'react';
import type { RobotLink } from '../../state/robot_link.ts';

/** What a frame in another site's page shows. `whole`: query and hash of the page that shows all of it; `children`: what stands under
 *  the body; `note`: what stands beside it while it is presented. */
export interface FrameProps {
  readonly link: RobotLink;
  readonly live: RobotLink;
  readonly whole: string;
  readonly name: string;
  readonly note?: ReactNode;
  readonly children: ReactNode;
}
