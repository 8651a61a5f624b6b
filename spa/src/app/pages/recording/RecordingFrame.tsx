import type { ComponentType } from 'react';
import { isolated } from '../../../twin/names.ts';
import { PastBar } from '../../past/index.ts';
import { usePresenting } from '../../state/presenting.ts';
import { useVersion } from '../../state/robot_link.ts';
import type { FrameProps } from './frame_props.ts';
import { NoteCaption } from './notes/NoteCaption.tsx';
import { PresentedNote } from './notes/PresentedNote.tsx';
import type { OpenedRecording } from './opened_recording.ts';
import { type PlayedRecording, useLost, useRecording } from './recording_link.ts';
import { useFetched } from './use_fetched.ts';
import { useRecordingText } from './words/recording_text.ts';
import { lostWords, unreadableWords } from './words/recording_words.ts';

type Frame = ComponentType<FrameProps>;

/** A recording in a frame of another site's page: body, state, origin, and a slim time line with the current note above it.
 *  `Frame` is the frame component of a robot, passed in for the same reason as a page's `Layout`. */
export function RecordingFrame({ Frame }: { Frame: Frame }) {
  useRecordingText();
  const opened = useFetched(true);
  if (opened === null) return null;
  if (opened instanceof Error)
    return (
      <p className="embed embed-note" role="alert" data-testid="no-recording">
        {unreadableWords(opened)}
      </p>
    );
  return <Opened Frame={Frame} opened={opened} />;
}

function Opened({ Frame, opened }: { Frame: Frame; opened: OpenedRecording }) {
  const played = useRecording(opened, true);
  return played === null ? null : <Shown {...{ Frame, opened, played }} />;
}

function Shown(props: { Frame: Frame; opened: OpenedRecording; played: PlayedRecording }) {
  const { Frame, opened, played } = props;
  const { link, controls, source } = played;
  const { title, segments, notes } = opened.index;
  useVersion(link);
  const presented = usePresenting();
  const lost = lostWords(useLost(source), segments.length);
  const { search, hash } = window.location;
  const name = title === null ? link.twin.name : isolated(title);
  return (
    <Frame
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
    </Frame>
  );
}
