/** uPlot asks for a number format in the browser's language while it is being loaded. In the locale C, as machines without a
 *  desktop have it, WebKitGTK's language is "C", of which `Intl` knows nothing: there would be no plots. Imported before uPlot. */
try {
  new Intl.NumberFormat(navigator.language);
} catch {
  Object.defineProperty(navigator, 'language', { value: 'en' });
}
