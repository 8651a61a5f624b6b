/** While loading, uPlot makes a number format for the browser's language. In the C locale, common on machines without a desktop,
 *  WebKitGTK reports the language "C". `Intl` throws for it, and plots would fail. Import this before uPlot.
 */
try {
  new Intl.NumberFormat(navigator.language);
} catch {
  Object.defineProperty(navigator, 'language', { value: 'en' });
}
