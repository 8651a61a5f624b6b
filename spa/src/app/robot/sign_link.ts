import '../shell/styles/signs.css';
import { RobotSigns, SIGNS } from '../../scene/signs/signs.ts';
import { isOld } from '../../twin/liveness.ts';
import { isolated, wordsOfName } from '../../twin/names.ts';
import { bodySigns, type RobotLink } from '../state/robot_link.ts';
import { onSettings, settings } from '../state/settings.ts';
import { onSelection, selection } from '../state/viewing.ts';
import { languageTag, onLanguage } from '../text/language.ts';

/** Feeds a robot's signs with each new frame, outside React, and `show`s them. They follow settings and language. Returns the signs,
 *  and a function that stops it. */
export function bindSigns(
  show: (signs: RobotSigns) => void,
  link: RobotLink,
): { signs: RobotSigns; stop: () => void } {
  const { twin, watch } = link;
  const signs = new RobotSigns();
  const onBody = bodySigns(link);
  onBody.signs = signs;
  const nameOf = (channel: string) => {
    const words = settings().names === 'words' ? wordsOfName(twin.schema, channel, languageTag()) : null;
    return isolated(words ?? channel);
  };
  const follow = () => {
    const { schema, state, limits, lead } = twin;
    if (schema === null || state === null || limits === null) signs.read(null);
    else
      signs.read({
        ...{ schema, limits, lead, nameOf, codes: state.codes, tS: state.tS },
        joint: selection()?.joint ?? null,
        live: !isOld(watch.verdict()),
        settings: settings(),
        language: languageTag(),
      });
    show(signs);
  };
  const leave = [
    twin.onState(follow),
    twin.onChange(follow),
    onSettings(follow),
    onLanguage(follow),
    watch.onWord(follow),
    onSelection(follow),
    ...SIGNS.flatMap(({ part }) => part?.subscribe(follow) ?? []),
  ];
  follow();
  return {
    signs,
    stop: () => {
      if (onBody.signs === signs) onBody.signs = null;
      for (const off of leave) off();
    },
  };
}
