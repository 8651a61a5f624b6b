import './recorded_chip.css';
import './recording.css';
import { useState } from 'react';
import { isolated } from '../../../twin/names.ts';
import { useMomentNamed } from '../../past/use_past.ts';
import { BackIcon, Icon, IconButton } from '../../shell/icons.tsx';
import { late } from '../../shell/late.tsx';
import { usePresenting } from '../../state/presenting.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { useRecordingText } from '../../text/late.ts';
import { OneRobot } from '../RobotPage.tsx';
import { AboutRecording } from './AboutRecording.tsx';
import type { OpenedRecording } from './opened_recording.ts';
import { PresentedNote } from './PresentedNote.tsx';
import { RecordingBar } from './RecordingBar.tsx';
import { type PlayedRecording, useRecording } from './recording_link.ts';
import { unreadableWords } from './recording_words.ts';
import { useFetched } from './use_fetched.ts';

const ShareSheet = late(async () => (await import('../../share/ShareSheet.tsx')).ShareSheet);

/** The page of a recording: the one that this page was exported with, or `given`, which the viewer opened and `onClose` closes. */
export function RecordingPage(props: {
  given: OpenedRecording | null;
  onClose: (() => void) | null;
  onSettings: (link: RobotLink) => void;
}) {
  const { given, onClose, onSettings } = props;
  const text = useRecordingText();
  const fetched = useFetched(given === null);
  const opened = given ?? fetched;
  if (opened === null) return <main className="broken" />;
  if (opened instanceof Error)
    return (
      <main className="broken" role="alert" data-testid="no-recording">
        <h1>{text.noRecording}</h1>
        <p>{unreadableWords(opened)}</p>
      </main>
    );
  return <Opened {...{ opened, onClose, onSettings }} />;
}

function Opened(props: {
  opened: OpenedRecording;
  onClose: (() => void) | null;
  onSettings: (link: RobotLink) => void;
}) {
  const { opened, onClose, onSettings } = props;
  const played = useRecording(opened, onClose === null);
  return played === null ? null : <Shown {...{ opened, played, onClose, onSettings }} />;
}

function Shown(props: {
  opened: OpenedRecording;
  played: PlayedRecording;
  onClose: (() => void) | null;
  onSettings: (link: RobotLink) => void;
}) {
  const { opened, played, onClose, onSettings } = props;
  const { link, controls, source } = played;
  const { index } = opened;
  const text = useRecordingText();
  const named = useMomentNamed();
  const presented = usePresenting();
  const [about, setAbout] = useState(false);
  useVersion(link);
  const { robot } = link.twin;
  const title = index.title === null ? link.twin.name : isolated(index.title);
  const name = `${link.twin.name} (${robot})`;
  const whole = index.title === null ? name : `${title} · ${name}`;
  return (
    <>
      <OneRobot
        link={link}
        live={onClose === null ? link : null}
        title={title}
        name={title}
        note={<PresentedNote controls={controls} notes={index.notes} />}
        head={
          <>
            {onClose !== null && (
              <IconButton onClick={onClose} label={text.close}>
                <BackIcon />
              </IconButton>
            )}
            <h1 className="robot-name recording-name" title={whole}>
              <button
                type="button"
                aria-haspopup="dialog"
                aria-label={`${title}. ${text.about}`}
                title={text.about}
                data-testid="about-button"
                onClick={() => setAbout(true)}
              >
                <span className="recording-title">{title}</span>
                {index.title !== null && <span className="recording-robot">{link.twin.name}</span>}
                <InfoIcon />
              </button>
            </h1>
          </>
        }
        share={
          onClose === null
            ? (close) => <ShareSheet robot={robot} name={title} recorded onClose={close} />
            : null
        }
        onSettings={() => onSettings(link)}
      >
        <RecordingBar
          {...{ controls, source, index }}
          twin={link.twin}
          manifestUrl={opened.manifestUrl}
          offered={opened.offered}
          isNonsense={onClose === null && named === 'nonsense'}
          unseen={presented}
        />
      </OneRobot>
      {about && (
        <AboutRecording
          {...{ index, source, controls }}
          robotName={link.twin.name}
          offered={opened.offered}
          onClose={() => setAbout(false)}
        />
      )}
    </>
  );
}

const InfoIcon = () => (
  <Icon>
    <circle cx="12" cy="12" r="8.5" />
    <path d="M12 11v5.5M12 7.6v.1" />
  </Icon>
);
