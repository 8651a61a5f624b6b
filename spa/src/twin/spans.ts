/** Spans of time, unix ms, without their ends. */
export type Spans = readonly { readonly fromMs: number; readonly toMs: number }[];

export function isWithin(atMs: number, spans: Spans): boolean {
  return spans.some(({ fromMs, toMs }) => atMs >= fromMs && atMs < toMs);
}
