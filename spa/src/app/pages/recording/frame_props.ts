import type { ReactNode } from 'react';
import type { RobotLink } from '../../state/robot_link.ts';

/** The content of a frame in another site's page. `whole`: query and hash of the full page; `children`: shown below the body;
 *  `note`: shown beside it while presenting. */
export interface FrameProps {
  readonly link: RobotLink;
  readonly live: RobotLink;
  readonly whole: string;
  readonly name: string;
  readonly note?: ReactNode;
  readonly children: ReactNode;
}
