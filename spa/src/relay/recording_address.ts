/** An exported recording is this page with a `<meta name="posecast-recording">` that names its `recording.json`. */

/** The address of the recording that this page was exported with; null if there is none. */
export function recordingUrl(): string | null {
  const meta = document.querySelector<HTMLMetaElement>('meta[name="posecast-recording"]');
  return meta === null ? null : new URL(meta.content, window.location.href.replace(/[?#].*$/, '')).href;
}

/** The early request for that address, sent before the code that reads its answer had loaded; null if there is none. */
export const early: {
  request: { readonly answer: Promise<Response>; readonly stop: AbortController } | null;
} = {
  request: null,
};
