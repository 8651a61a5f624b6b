/** The doctor's findings about implausible masses: the texts of the findings with such a code
 *  (docs/reference/model-bundle.md). */
export function toldOfMasses(findings: unknown): unknown[] {
  if (!Array.isArray(findings)) return [];
  return findings.flatMap((finding) => {
    const { code, text } = (finding ?? {}) as { code?: unknown; text?: unknown };
    return typeof code === 'string' && /^(mass|inertia)/.test(code) ? [text] : [];
  });
}
