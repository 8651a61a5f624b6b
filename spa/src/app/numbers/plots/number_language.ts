/** While loading, uPlot makes a number format for the browser's language. In the locale C, as on machines without a
 *  desktop, WebKitGTK's language is "C", for which `Intl` throws, so there would be no plots. Import this before uPlot.
 *  */
try {
  new Intl.NumberFormat(navigator.language);
} catch {
  Object.defineProperty(navigator, 'language', { value: 'en' });
}
