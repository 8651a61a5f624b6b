// Before the first paint: light or dark, as chosen here or else by the system.
{
  const chosen = __md_get('__palette')?.color;
  const follows = chosen === undefined || chosen.media === '(prefers-color-scheme)';
  const dark = follows ? matchMedia('(prefers-color-scheme: dark)').matches : chosen.scheme === 'slate';
  document.body.setAttribute('data-md-color-scheme', dark ? 'slate' : 'default');
}
