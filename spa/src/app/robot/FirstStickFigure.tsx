import { useEffect, useRef } from 'react';
import { builtModelAt } from '../../model/files.ts';
import { StickFigure } from '../../scene/figure/stick_figure.ts';
import { Poser } from '../../twin/playback/pose.ts';
import { useTheme } from '../shell/theme.ts';
import { type RobotLink, useVersion } from '../state/robot_link.ts';
import { settings } from '../state/settings.ts';

/** Draws the robot as a stick figure as soon as its model's manifest is loaded, usually before the renderer and the meshes. Draws
 *  nothing for raw bundles, which list no joints. */
export function FirstStickFigure({ link }: { link: RobotLink }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const theme = useTheme();
  useVersion(link);
  const { modelHash } = link.twin;
  // biome-ignore lint/correctness/useExhaustiveDependencies: the line colour depends on the theme
  useEffect(() => {
    const { current } = canvas;
    if (current === null || modelHash === null) return;
    let leave: (() => void) | null = null;
    let left = false;
    builtModelAt(link.manifestUrl(modelHash))
      .then((manifest) => {
        if (left || manifest === null) return; // the joints of a raw bundle are unknown until its URDF is read
        const figure = new StickFigure(current, manifest);
        figure.setColor(getComputedStyle(current).color);
        leave = follow(figure, link);
      })
      .catch(() => {}); // the scene loads the same file and reports errors
    return () => {
      left = true;
      leave?.();
    };
  }, [link, modelHash, theme]);
  return <canvas ref={canvas} className="first-sketch" data-testid="first-sketch" />;
}

function follow(figure: StickFigure, { twin }: RobotLink): () => void {
  let poser: Poser | null = null;
  let of: unknown = null;
  const pose = () => {
    const { schema, state } = twin;
    if (schema === null || state === null) return;
    if (poser === null || of !== schema) {
      const told = settings().shown === 'ref' && schema.field('ref') !== null;
      poser = new Poser(schema, told ? 'ref' : 'pos');
      of = schema;
    }
    figure.setPose(poser.pose(state.codes));
  };
  pose();
  return twin.onState(pose);
}
