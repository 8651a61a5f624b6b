import { useEffect, useRef, useState } from 'react';
import { manifestUrl } from '../../../auth/lane.ts';
import { tokenFor } from '../../../auth/token.ts';
import { manifestAt } from '../../../model/files.ts';
import { readManifest } from '../../../model/manifest.ts';
import { streamUrl } from '../../../relay/addresses.ts';
import { PreviewStream } from '../../../stream/preview/preview_stream.ts';
import { type Pose, Poser } from '../../../twin/playback/pose.ts';
import { withoutHeading } from '../../../twin/rotation.ts';
import { StickFigure } from '../../../view/stick_figure.ts';
import { useTheme } from '../../shell/theme.ts';

/** A pointer that only crosses a card starts no preview. */
const SETTLE_MS = 200;

/** A moving line drawing of the robot over its picture, updated once a second. Nothing is shown for raw bundles, which list no
 *  joints, or before the first pose. */
export function Preview({ robot, model }: { robot: string; model: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [moves, setMoves] = useState(false);
  const theme = useTheme();
  // biome-ignore lint/correctness/useExhaustiveDependencies: the line colour depends on the theme
  useEffect(() => {
    const { current } = canvas;
    let stream: PreviewStream | null = null;
    let left = false;
    const open = async () => {
      const raw = await manifestAt(manifestUrl(robot, model));
      if (left || current === null || raw.v !== 2) return;
      const figure = new StickFigure(current, readManifest(raw));
      figure.setColor(getComputedStyle(current).color);
      const pose = standing();
      const url = streamUrl(robot);
      stream = new PreviewStream(
        url,
        tokenFor(url),
        (schema, codes) => {
          figure.setPose(pose(new Poser(schema, 'pos').pose(codes)));
          setMoves(true);
        },
        () => setMoves(false),
      );
    };
    const timer = setTimeout(() => open().catch(() => {}), SETTLE_MS); // the card still has its picture
    return () => {
      left = true;
      clearTimeout(timer);
      stream?.close();
      setMoves(false);
    };
  }, [robot, model, theme]);
  return (
    // biome-ignore lint/a11y/noAriaHiddenOnFocusable: a canvas takes no focus, and the card has the text
    <canvas
      ref={canvas}
      className="thumb-preview"
      aria-hidden="true"
      data-testid="preview"
      data-moves={moves}
    />
  );
}

/** Keeps a walking robot at its first position and heading, because a line drawing from the side tells little. */
function standing(): (pose: Pose) => Pose {
  let first: readonly number[] | null = null;
  return (pose) => {
    if (pose.base === null) return pose;
    const { xyz, quat_wxyz } = pose.base;
    first ??= xyz;
    return { ...pose, base: { xyz: [first[0]!, first[1]!, xyz[2]], quat_wxyz: withoutHeading(quat_wxyz) } };
  };
}
