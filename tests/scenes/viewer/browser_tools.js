// What scripts inside of pages need: they check, wait, press keys, and send what they found to browser.py.
window.driver = (() => {
  const found = {problems: [], checks: 0, complaints: []};
  addEventListener('error', (event) => found.complaints.push(event.message));
  addEventListener('unhandledrejection', (event) => found.complaints.push(String(event.reason)));
  const check = (what, good, seen) => {
    ++found.checks;
    if (!good) found.problems.push(`${what}: ${JSON.stringify(seen)}`);
  };
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const until = async (what, condition) => {
    for (let k = 0; k < 1500; ++k) {
      if (condition()) return check(what, true);
      await pause(20);
    }
    check(what, false, 'did not happen');
  };
  const press = (key, more = {}) => document.body.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true, ...more}));
  const send = (what) => fetch('http://127.0.0.1:PORT', {method: 'POST', mode: 'no-cors', body: JSON.stringify(what)});
  const drive = async (script) => {
    try {
      for (let k = 0; k < 1500 && document.getElementById('message').textContent === 'Loading'; ++k) await pause(20);
      found.message = document.getElementById('message').textContent;
      if (found.message === '') await script();
    } catch (error) {
      found.problems.push(`the driver stopped: ${error.stack}`);
    } finally {
      await send(found);
    }
  };
  return {found, check, pause, until, press, send, drive};
})();
