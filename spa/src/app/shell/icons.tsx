import type { ComponentPropsWithRef, ReactNode } from 'react';

/** An SVG icon. `children` are drawn in a view box of 24 × 24; colour and size are those of the text around it. */
export function Icon({ children }: { children: ReactNode }) {
  return (
    <svg
      className="icon"
      viewBox="0 0 24 24"
      fill="none"
      stroke="currentColor"
      strokeWidth="1.75"
      strokeLinecap="round"
      strokeLinejoin="round"
      aria-hidden="true"
    >
      {children}
    </svg>
  );
}

/** A button that shows only an icon. Screen readers read `label`. */
export function IconButton({ label, ...rest }: { label: string } & ComponentPropsWithRef<'button'>) {
  return <button type="button" className="icon-button" aria-label={label} {...rest} />;
}

export const BackIcon = () => (
  <Icon>
    <path d="M15 5l-7 7 7 7" />
  </Icon>
);

export const PanelIcon = () => (
  <Icon>
    <rect x="3.5" y="5" width="17" height="14" rx="2.5" />
    <path d="M14.5 5v14" />
  </Icon>
);

export const FullscreenIcon = () => (
  <Icon>
    <path d="M4 9V5.5A1.5 1.5 0 0 1 5.5 4H9M15 4h3.5A1.5 1.5 0 0 1 20 5.5V9M20 15v3.5a1.5 1.5 0 0 1-1.5 1.5H15M9 20H5.5A1.5 1.5 0 0 1 4 18.5V15" />
  </Icon>
);

export const ShareIcon = () => (
  <Icon>
    <path d="M12 14.5V4M8.2 7.4L12 3.6l3.8 3.8" />
    <path d="M7.5 11H6a1.5 1.5 0 0 0-1.5 1.5V19A1.5 1.5 0 0 0 6 20.5h12a1.5 1.5 0 0 0 1.5-1.5v-6.5A1.5 1.5 0 0 0 18 11h-1.5" />
  </Icon>
);

export const SettingsIcon = () => (
  <Icon>
    <path d="M4 7h9M19 7h1M4 17h1M11 17h9" />
    <circle cx="16" cy="7" r="2.6" />
    <circle cx="8" cy="17" r="2.6" />
  </Icon>
);

/** The drawing of a robot that a card shows while there is no picture of the robot itself. */
export const RobotFigure = () => (
  <svg className="figure" viewBox="0 0 64 64" fill="none" stroke="currentColor" aria-hidden="true">
    <g strokeWidth="1.8" strokeLinecap="round" strokeLinejoin="round">
      <rect x="25" y="6" width="14" height="11" rx="5" />
      <path d="M32 17v4M23 21h18l-2.5 15h-13zM23 22l-6 9 1.5 9M41 22l6 9-1.5 9M28 36l-2 11 1 11h-4M36 36l2 11-1 11h4" />
      <path d="M29 11.5h.01M35 11.5h.01" />
    </g>
  </svg>
);

/** The shape of the past: an arrow back in a circle. */
export const PastIcon = () => (
  <Icon>
    <circle cx="12" cy="12" r="9" />
    <path d="M16.5 12H8M11.4 8.4L7.8 12l3.6 3.6" />
  </Icon>
);
