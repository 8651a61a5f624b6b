import { useState } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import type { Note, RecordingIndex } from '../../../past/recording/recording_index.ts';
import type { RecordingPast } from '../../../past/recording/recording_past.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { PastBar } from '../../past/PastBar.tsx';
import type { OfferedFile } from '../../past/save/OfferedFiles.tsx';
import { useRecordingText } from '../../text/late.ts';
import { NoteCaption } from './NoteCaption.tsx';
import { NoteMarks } from './NoteMarks.tsx';
import { useLost } from './recording_link.ts';
import { lostWords } from './recording_words.ts';

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
