import { useEffect, useState } from 'react';
import { tokenFor } from '../../../auth/token.ts';
import { fetchBytes, fetchManifest, fileUrl } from '../../../model/bundle.ts';
import { thumbnailOf } from '../../../model/manifest.ts';
import { manifestUrl } from '../../../relay/addresses.ts';
import { RobotFigure } from '../../shell/icons.tsx';
import type { ListedRobot } from './robots.ts';

const PICTURE_BYTES = 500_000;

/** The picture in a robot's model bundle; a generic drawing if there is none or the robot is not online. */
export function Thumbnail({ robot: { robot, model, state } }: { robot: ListedRobot }) {
  const [src, setSrc] = useState<string | null>(null);
  const here = state === 'online';
  useEffect(() => {
    if (model === null || !here) return; // the picture comes from the robot's edge, which must be connected
    const leave = new AbortController();
    const url = manifestUrl(robot, model);
    let made = '';
    const picture = async () => {
      const path = thumbnailOf(await fetchManifest(url, leave.signal));
      const file = path === null ? null : fileUrl(url, { path });
      if (file === null || tokenFor(file) === undefined) return file;
      // an <img> can't send a token
      const bytes = await fetchBytes(file, PICTURE_BYTES, leave.signal, () => {});
      made = URL.createObjectURL(new Blob([new Uint8Array(bytes)]));
      return made;
    };
    picture()
      .then((found) => !leave.signal.aborted && setSrc(found))
      .catch(() => {}); // the list works without pictures
    return () => {
      leave.abort();
      URL.revokeObjectURL(made);
    };
  }, [robot, model, here]);
  if (src === null) return <RobotFigure />;
  return (
    <img className="thumb-picture" src={src} alt="" onError={() => setSrc(null)} data-testid="thumbnail" />
  );
}
