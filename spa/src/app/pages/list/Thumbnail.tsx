import { useEffect, useState } from 'react';
import { fetchBytes, fetchManifest, fileUrl } from '../../../model/bundle.ts';
import { thumbnailOf } from '../../../model/manifest.ts';
import { manifestUrl } from '../../../relay/lane.ts';
import { tokenFor } from '../../../relay/token.ts';
import { RobotFigure } from '../../shell/icons.tsx';
import type { ListedRobot } from './robots.ts';

const PICTURE_BYTES = 500_000;

/** The picture in a robot's model bundle, which the relay may still have after the robot has left; otherwise a generic
 *  drawing. */
export function Thumbnail({ robot: { robot, model } }: { robot: ListedRobot }) {
  const [src, setSrc] = useState<string | null>(null);
  useEffect(() => {
    if (model === null) return;
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
  }, [robot, model]);
  if (src === null) return <RobotFigure />;
  return (
    <img
      className="thumb-picture"
      src={src}
      crossOrigin="anonymous" // no cookies for another relay or a lane
      alt=""
      onError={() => setSrc(null)}
      data-testid="thumbnail"
    />
  );
}
