import { Icon } from '../../shell/icons.tsx';

export const PlayIcon = () => (
  <Icon>
    <path d="M8 5.4v13.2L18.6 12z" fill="currentColor" />
  </Icon>
);

export const PauseIcon = () => (
  <Icon>
    <path d="M8.5 6v12M15.5 6v12" strokeWidth="3" />
  </Icon>
);

/** A leaf of a calendar. */
export const JumpIcon = () => (
  <Icon>
    <path d="M4.5 7.5a2 2 0 0 1 2-2h11a2 2 0 0 1 2 2v10a2 2 0 0 1-2 2h-11a2 2 0 0 1-2-2zM4.5 10.5h15M8.5 3.5v4M15.5 3.5v4M12 13v2.6l1.8 1" />
  </Icon>
);
