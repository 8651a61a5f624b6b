import { useEffect, useState } from 'react';
import { home, relayChoice } from '../../relay/relay.ts';
import { tokenFor } from '../../relay/token.ts';
import { Command } from '../shell/Command.tsx';
import { Dialog } from '../shell/Dialog.tsx';
import { withKey } from '../shell/page_keys.ts';
import { address } from '../state/address.ts';
import { useStore } from '../state/hooks.ts';
import { present } from '../state/viewing.ts';
import '../shell/styles/dialog.css';
import { useMore, useText } from '../text/language.ts';
import { QrCode } from './QrCode.tsx';

/** The dialog for sharing this view: its address as a link, as a QR code and as an `<iframe>` for a web page. `robot` is the id,
 *  `name` what people read. `recorded`: a recording, on a host that knows no robots. */
export function ShareSheet({
  robot,
  name,
  recorded = false,
  onClose,
}: {
  robot: string;
  name: string;
  recorded?: boolean;
  onClose: () => void;
}) {
  const text = useText();
  const rest = useMore();
  const named = usePathOf(recorded ? null : robot);
  useStore(address);
  const link = sharedLink(window.location.href, named);
  const { hostname } = window.location;
  const onlyHere = /^(localhost|127\.|\[::1\])/.test(hostname);
  return (
    <Dialog title={text.share} testId="share" onClose={onClose}>
      <QrCode text={link} className="share-code" />
      {onlyHere && (
        <p className="share-remark" data-testid="only-here">
          {rest.onlyThisComputer(hostname)}
        </p>
      )}
      <button
        type="button"
        className="text-button share-native"
        title={withKey(rest.present, 'present')}
        data-testid="present"
        onClick={() => {
          onClose();
          present(true);
        }}
      >
        {rest.present}
      </button>
      <p className="quiet share-what">{rest.presentWhat}</p>
      <Command what={rest.asYouSeeIt(name)} line={link} />
      {'share' in navigator && (
        <button
          type="button"
          className="text-button share-native"
          onClick={() => void navigator.share({ title: name, url: link }).catch(() => {})}
        >
          {rest.anotherApp}
        </button>
      )}
      {seesMore(robot) && (
        <a className="text-button share-native" href={seenByAnyone(link)} data-testid="seen-by-anyone">
          {rest.seenByAnyone}
        </a>
      )}
      <Command
        what={rest.inYourPage}
        line={recorded ? recordedFrame(link, name) : frameFor(link, robot, name)}
      />
    </Dialog>
  );
}

/** The address of the robot's page without `#`, for which chats show the robot's name and picture. null until the host of this
 *  page has confirmed that it knows it: a relay does, a plain web server does not. */
function usePathOf(robot: string | null): string | null {
  const [known, setKnown] = useState<string | null>(null);
  useEffect(() => {
    if (robot === null || relayChoice().base !== home()) return;
    const leave = new AbortController();
    const url = `${home()}r/${robot}`;
    fetch(url, { method: 'HEAD', signal: leave.signal })
      .then(({ ok }) => ok && setKnown(url))
      .catch(() => {}); // otherwise the link is the one with `#`
    return () => leave.abort();
  }, [robot]);
  return known;
}

/** The address of the view at `at`; below `page`, unless that is null. Omits how this page reads the robot, because others use
 *  their own way. */
export function sharedLink(at: string, page: string | null): string {
  const { origin, pathname, search, hash } = new URL(at);
  const kept = search
    .slice(1)
    .split('&')
    .filter((part) => part !== '' && !part.startsWith('lane='));
  return `${page ?? origin + pathname}${kept.length === 0 ? '' : `?${kept.join('&')}`}${hash}`;
}

/** Whether this page uses a token for the robot, so that people without one may see less. */
function seesMore(robot: string): boolean {
  return tokenFor(`/api/v1/robots/${robot}/`) !== undefined;
}

/** The address of the same view without any token: with `?as=anyone`, the page shows only what anyone may see. */
export function seenByAnyone(link: string): string {
  const url = new URL(link);
  url.searchParams.set('as', 'anyone');
  return url.href;
}

/** The HTML `<iframe>` element that shows the view of `link` in another page. Its path names the robot, so that the relay can
 *  restrict which pages may embed it. Throws if `link` is no URL. */
export function frameFor(link: string, robot: string, name: string): string {
  const { search, hash } = new URL(link);
  return frameOf(new URL(`embed/${robot}${search}${hash.includes('?') ? hash : ''}`, home()), name);
}

/** The same for an exported recording, on a host that may not serve a folder's index page. */
function recordedFrame(link: string, name: string): string {
  const { search, hash } = new URL(link);
  return frameOf(new URL(`embed/index.html${search}${hash}`, home()), name);
}

function frameOf({ href: source }: URL, name: string): string {
  const title = name.replace(/[&"<>]/g, (sign) => `&#${sign.charCodeAt(0)};`);
  return `<iframe src="${source.replace(/&/g, '&amp;')}" title="${title}" style="width: 100%; aspect-ratio: 16 / 10; border: 0" allow="fullscreen" loading="lazy"></iframe>`;
}
