import { Icon } from '../../shell/icons.tsx';

/** One frame: a triangle that points the way, and a bar. */
export const FrameBackIcon = () => (
  <Icon>
    <path d="M17 6.5v11L8.2 12zM5.6 6.5v11" />
  </Icon>
);

export const FrameOnIcon = () => (
  <Icon>
    <path d="M7 6.5v11l8.8-5.5zM18.4 6.5v11" />
  </Icon>
);

const OCTAGON = 'l3.2-3.2h4.6l3.2 3.2v4.6l-3.2 3.2h-4.6l-3.2-3.2z';

/** A fault's octagon, and the way to it. */
export const PreviousFaultIcon = () => (
  <Icon>
    <path d={`M10.5 9.7${OCTAGON}M6.5 7.5L2.5 12l4 4.5`} />
  </Icon>
);

export const NextFaultIcon = () => (
  <Icon>
    <path d={`M2.5 9.7${OCTAGON}M17.5 7.5l4 4.5-4 4.5`} />
  </Icon>
);

export const LoopIcon = () => (
  <Icon>
    <path d="M4.5 11.5V10A3.5 3.5 0 0 1 8 6.5h11M16 3.5l3 3-3 3M19.5 12.5V14a3.5 3.5 0 0 1-3.5 3.5H5M8 20.5l-3-3 3-3" />
  </Icon>
);

/** An arrow into a tray. */
export const SaveIcon = () => (
  <Icon>
    <path d="M12 4v11M8 11.2l4 4 4-4M4.5 15.5V18A1.5 1.5 0 0 0 6 19.5h12a1.5 1.5 0 0 0 1.5-1.5v-2.5" />
  </Icon>
);
