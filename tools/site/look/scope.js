// Must run before Zensical's own script: where this site keeps its settings in the browser. A separate file,
// so that a Content-Security-Policy can forbid inline scripts.
window.__md_scope = new URL(document.currentScript.dataset.base, location);
if (!__md_scope.pathname.endsWith('/')) __md_scope = new URL(`${__md_scope.pathname}/`, location);
window.__md_hash = (text) => [...text].reduce((sum, letter) => (sum << 5) - sum + letter.charCodeAt(0), 0);
window.__md_get = (key, store = localStorage, scope = __md_scope) => {
  try {
    return JSON.parse(store.getItem(`${scope.pathname}.${key}`));
  } catch {
    return null;
  }
};
window.__md_set = (key, value, store = localStorage, scope = __md_scope) => {
  try {
    store.setItem(`${scope.pathname}.${key}`, JSON.stringify(value));
  } catch {}
};
document.documentElement.setAttribute('data-platform', navigator.platform);
