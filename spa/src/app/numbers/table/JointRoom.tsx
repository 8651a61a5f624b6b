import { useEffect, useMemo, useState } from 'react';
import { manifestAt } from '../../../model/files.ts';
import { type Manifest, readManifest } from '../../../model/manifest.ts';
import { type Display, displayOf, formatNumber } from '../../../twin/format.ts';
import { JointChannels } from '../../../twin/kinematic_tree.ts';
import { limitMargin } from '../../../twin/limits.ts';
import { isolated } from '../../../twin/names.ts';
import { Poser } from '../../../twin/playback/pose.ts';
import { useNow } from '../../shell/now.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { useSettings } from '../../state/settings.ts';
import { type BalanceText, useBalanceText } from '../../text/balance.ts';

/** Numbers that change faster can't be read. */
const EVERY_MS = 250;
/** If less than this part of the joint's range is left, it is marked. */
const CAUTION_PART = 0.05;

/** The distance from a joint to its end stops, which come from the model: one line for each model joint that the channel moves.
 *  Empty for joints without limits. */
export function JointRoom({ link, joint }: { link: RobotLink; joint: string }) {
  useNow(EVERY_MS);
  const { angle } = useSettings();
  const text = useBalanceText();
  const room = useRooms(link, joint);
  const { state } = link.twin;
  if (room === null || state === null) return null;
  const { poser, joints } = room;
  const values = poser.values(state.codes);
  const lines = joints.flatMap(({ name, limits, slides }) => {
    const at = poser.joints.indexOf(name);
    const left = limitMargin(values[at] ?? null, limits);
    if (left === null) return [];
    return [{ name, left, display: displayOf(slides ? 'm' : 'rad', angle) }];
  });
  return lines.map(({ name, left, display }) => (
    <p
      className="card-room-left"
      key={name}
      data-testid="joint-room"
      data-level={left.part / 2 < CAUTION_PART ? 'caution' : 'ok'}
    >
      <button type="button" className="term" data-explain="balance.room" aria-haspopup="dialog">
        {text.room}
      </button>{' '}
      {lines.length > 1 || name !== joint ? `${isolated(name)}: ` : ''}
      {roomWords(left, display, text)}
    </p>
  ));
}

function roomWords(
  { left, nearer, part }: NonNullable<ReturnType<typeof limitMargin>>,
  display: Display,
  text: BalanceText,
): string {
  const value = `${formatNumber(Math.abs(left), display).trim()} ${display.unit}`;
  if (left < 0) return nearer === 'lower' ? text.beyondLower(value) : text.beyondUpper(value);
  const words = nearer === 'lower' ? text.toLower(value) : text.toUpper(value);
  return `${words}, ${text.ofItsWay(`${Math.round(part * 50)} %`)}`;
}

/** The model joints that the channel moves and that have limits; null before the model has loaded. */
function useRooms(link: RobotLink, joint: string) {
  useVersion(link);
  const { schema, modelHash } = link.twin;
  const { manifestUrl } = link;
  const [manifest, setManifest] = useState<Manifest | null>(null);
  useEffect(() => {
    setManifest(null);
    if (modelHash === null) return;
    let left = false;
    manifestAt(manifestUrl(modelHash))
      .then((raw) => !left && raw.v === 2 && setManifest(readManifest(raw)))
      .catch(() => {}); // the body reports the reason
    return () => {
      left = true;
    };
  }, [manifestUrl, modelHash]);
  return useMemo(() => {
    if (schema === null || manifest === null) return null;
    const moved = new JointChannels(schema).jointsOf(joint);
    const joints = manifest.joints.flatMap(({ name, type, limits }) =>
      limits !== null && type !== 'continuous' && moved.includes(name)
        ? [{ name, limits, slides: type === 'prismatic' }]
        : [],
    );
    return { poser: new Poser(schema, 'pos'), joints };
  }, [schema, manifest, joint]);
}
