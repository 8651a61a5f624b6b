import '../recording/recording.css';
import { isolated } from '../../../twin/names.ts';
import { PastBar } from '../../past/PastBar.tsx';
import { useVersion } from '../../state/robot_link.ts';
import { usePresenting } from '../../state/viewing.ts';
import { useRecordingText } from '../../text/late.ts';
import { NoteCaption, PresentedNote } from '../recording/Notes.tsx';
import type { OpenedRecording } from '../recording/opened_recording.ts';
import { type PlayedRecording, useFetched, useLost, useRecording } from '../recording/recording_link.ts';
import { lostWords, unreadableWords } from '../recording/recording_words.ts';
import { Framed } from './Framed.tsx';

/** A recording in a frame of another site's page: body, state, origin, and a slim time line with the current note above it. */
export function RecordingFrame() {
  useRecordingText();
  const opened = useFetched(true);
  if (opened === null) return null;
  if (opened instanceof Error)
    return (
      <p className="embed embed-note" role="alert" data-testid="no-recording">
        {unreadableWords(opened)}
      </p>
    );
  return <Opened opened={opened} />;
}

function Opened({ opened }: { opened: OpenedRecording }) {
  const played = useRecording(opened, true);
  return played === null ? null : <Shown {...{ opened, played }} />;
}

function Shown(props: { opened: OpenedRecording; played: PlayedRecording }) {
  const { opened, played } = props;
  const { link, controls, source } = played;
  const { title, segments, notes } = opened.index;
  useVersion(link);
  const presented = usePresenting();
  const lost = lostWords(useLost(source), segments.length);
  const { search, hash } = window.location;
  const name = title === null ? link.twin.name : isolated(title);
  return (
    <Framed
      {...{ link, name }}
      live={link}
      whole={`index.html${search}${hash}`}
      note={<PresentedNote controls={controls} notes={notes} />}
    >
      {lost !== null && (
        <p className="embed-lost" role="status" data-testid="recording-lost">
          {lost}
        </p>
      )}
      {notes.length > 0 && !presented && <NoteCaption controls={controls} notes={notes} />}
      <PastBar controls={controls} live={null} twin={link.twin} source={null} unseen={presented} slim />
    </Framed>
  );
}
