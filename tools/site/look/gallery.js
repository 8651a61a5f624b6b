// Plays a recorded moment in a frame in place of its poster, one at a time. Without it a poster's link opens the
// recording as a page of its own.
{
  let shown = null; // the frame, and the poster that it stands in for
  const theme = () => (document.body.dataset.mdColorScheme === 'slate' ? 'dark' : 'light');
  const tell = (message) => shown?.frame.contentWindow.postMessage(message, location.origin);
  const play = (poster) => {
    shown?.frame.replaceWith(shown.poster);
    const frame = document.createElement('iframe');
    frame.src = `${poster.dataset.frame}?origin=${location.origin}#/?theme=${theme()}`;
    frame.title = poster.dataset.title;
    frame.allow = 'fullscreen';
    poster.replaceWith(frame);
    shown = { frame, poster };
    frame.focus();
  };
  for (const poster of document.querySelectorAll('.moment > a')) {
    if (location.protocol === 'file:') {
      // a browser runs no modules from files
      poster.removeAttribute('href');
      poster.querySelector('span').textContent = 'Open the guide from a web server to play this';
      continue;
    }
    poster.addEventListener('click', (event) => {
      if (event.ctrlKey || event.metaKey || event.shiftKey) return; // a tab or window of its own is wanted
      event.preventDefault();
      play(poster);
    });
  }
  addEventListener('message', ({ source, origin, data }) => {
    if (origin !== location.origin || source !== shown?.frame.contentWindow || data.posecast !== 'ready')
      return;
    tell({ posecast: 'play' });
  });
  new MutationObserver(() => tell({ posecast: 'set', theme: theme() })).observe(document.body, {
    attributeFilter: ['data-md-color-scheme'],
  });
}
