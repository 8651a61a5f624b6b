import './recording.css';
import { useState } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note, RecordingIndex } from '../../../past/recording/recording_index.ts';
import type { RecordingPast } from '../../../past/recording/recording_past.ts';
import { isolated } from '../../../twin/names.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { PastBar } from '../../past/PastBar.tsx';
import { useMomentNamed } from '../../past/PastBelowBody.tsx';
import type { OfferedFile } from '../../past/save/Outcome.tsx';
import { BackIcon, Icon, IconButton } from '../../shell/icons.tsx';
import { late } from '../../shell/late.tsx';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { usePresenting } from '../../state/viewing.ts';
import { useRecordingText } from '../../text/late.ts';
import { OneRobot } from '../RobotPage.tsx';
import { AboutRecording } from './AboutRecording.tsx';
import { NoteCaption, NoteMarks, PresentedNote } from './Notes.tsx';
import type { OpenedRecording } from './opened_recording.ts';
import { type PlayedRecording, useFetched, useLost, useRecording } from './recording_link.ts';
import { lostWords, unreadableWords } from './recording_words.ts';

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

/** Shown below the body of a recording: the missing parts, the note of the moment, and the time line. */
export function RecordingBar(props: {
  controls: PastControls;
  twin: RobotTwin;
  manifestUrl: (sha256: string) => string;
  offered: readonly OfferedFile[];
  source: RecordingPast;
  index: RecordingIndex;
  /** The moment in the address can't be read. */
  isNonsense: boolean;
  /** While presenting, only its keyboard shortcuts are active. */
  unseen: boolean;
}) {
  const { controls, twin, manifestUrl, offered, source, index, isNonsense, unseen } = props;
  const { notes, segments } = index;
  const text = useRecordingText();
  const [pointed, setPointed] = useState<readonly Note[] | null>(null);
  const lost = lostWords(useLost(source), segments.length);
  if (unseen) return <PastBar controls={controls} live={null} twin={twin} source={null} unseen />;
  return (
    <>
      {lost !== null && (
        <p className="recording-lost" role="status" data-testid="recording-lost">
          {lost}
        </p>
      )}
      {isNonsense && (
        <p className="recording-lost" role="status" data-testid="past-note">
          {text.noMoment}
        </p>
      )}
      {notes.length > 0 && <NoteCaption controls={controls} notes={notes} pointed={pointed} />}
      <PastBar
        controls={controls}
        live={null}
        twin={twin}
        source={source}
        manifestUrl={manifestUrl}
        offered={offered}
        notes={
          notes.length === 0
            ? null
            : (view) => (
                <NoteMarks
                  notes={notes}
                  view={view}
                  onPoint={setPointed}
                  onGo={(atMs) => controls.seek(atMs)}
                />
              )
        }
      />
    </>
  );
}
