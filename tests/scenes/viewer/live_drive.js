// Runs inside of the page of a live run: does to it what a person would, and looks at what comes back from the engine. See live_test.py.
driver.drive(async () => {
  const $ = (id) => document.getElementById(id), {found, check, pause, until, press} = driver;
  const v = window.islet, {film} = v, {source} = film;
  const shown = () => film.number('number', v.shown.i), newest = () => film.number('number', film.frames - 1);
  const height = (body) => v.shown.frame.positions[3 * body + 2];
  const slide = (id, value) => {
    $(id).value = value;
    $(id).dispatchEvent(new Event('input'));
  };
  const bodies = () => film.head.bodies.kind.length;
  await until('a frame is shown', () => v.shown !== null);
  const beforeReload = JSON.parse(sessionStorage.getItem('beforeReload'));
  if (beforeReload) return afterReload(beforeReload);
  check('the controls are there', !$('live-panel').hidden);
  check('it begins paused, at its beginning', shown() === 0 && !source.state.running, [shown(), source.state]);
  check('no sideways scrolling', document.documentElement.scrollWidth <= window.innerWidth, document.documentElement.scrollWidth);
  const top = film.head.bodies.kind.length - 1, start = height(top);

  // A step, a run, a pause.
  $('forward').click();
  await until('a step', () => shown() === 1);
  await pause(200);
  check('one step alone', newest() === 1 && !source.state.running, newest());
  $('play').click();
  await until('it runs', () => source.state.running && shown() >= 20);
  check('it is told', $('play').getAttribute('aria-label') === 'Pause');
  check('the top has fallen', height(top) < start - 0.01, [start, height(top)]);
  press(' ');
  await until('it is paused', () => !source.state.running);
  await pause(200);
  const stopped = newest();
  await until('the last step is shown', () => shown() === stopped);
  await pause(300);
  check('no step comes after it', newest() === stopped, [stopped, newest()]);

  press('r');
  check('a run that nobody changed can be made again', !$('again').hidden && $('not-again').hidden && /State hash/.test($('report').textContent), $('report').textContent);
  check('steps', new RegExp(`Steps${newest()}Of these in this page, and counted below${film.frames - 1}`).test($('report').textContent), $('report').textContent);
  check('problems that failed', /Problems that failed0/.test($('report').textContent), $('report').textContent);

  // A ball: there at once, then it flies.
  const before = bodies(), drawn = v.bodies.drawn;
  $('throw').click();
  await until('one body more', () => bodies() === before + 1 && v.bodies.drawn === drawn + 1 && v.shown.frame.frozen.length === before + 1);
  const ball = [...v.shown.frame.positions.subarray(3 * before, 3 * before + 3)];
  await until('a run that was changed has no command', () => $('again').hidden && !$('not-again').hidden && !/State hash/.test($('report').textContent));
  press('r');
  check('it is behind the wall, before the stack', v.walls.parts.length === 2 && ball[1] > -3.75 && ball[1] < -1 && ball[2] > 0, ball);
  check('no step was made for it', newest() === stopped, newest());
  v.pick(before);
  $('forward').click();
  await until('the ball flies', () => Math.abs(v.shown.frame.positions[3 * before] - ball[0]) > 0.05);
  await until('its numbers', () => /sphere.*Mass.*kg/.test($('picked-body').textContent));
  press('ArrowLeft');
  press('ArrowLeft');
  await until('before it was thrown', () => /is not there yet/.test($('picked-body').textContent) && !v.bodies.halo.visible);
  press('End');
  await until('the newest again', () => v.player.following && shown() === newest());
  v.pick(-1);
  v.live.ask({do: 'throw', from: [...v.shown.frame.positions.subarray(3 * top, 3 * top + 3)], velocity: [0, 0, 0], radius: 0.1, density: 1});
  await until('what is refused is told', () => /does not fit/.test($('live-note').textContent));

  // A ball of what is too heavy or too small for the run is one that it takes.
  const {live} = v, {ask, bodyMass, bodyRadius} = live;
  let asked = null;
  live.ask = (message) => (asked = message);
  live.bodyMass = 1e12;
  live.throwBall(null);
  check('the heaviest ball', asked.density === 1e6 && asked.density === source.state.ball.density[1], asked);
  Object.assign(live, {bodyMass, bodyRadius: 1e-9});
  live.throwBall(null);
  check('the smallest ball', asked.radius === source.state.ball.radius[0], asked);
  Object.assign(live, {ask, bodyRadius});

  // The camera sees where all has got to.
  const seen = v.stage.extent.clone();
  $('camera').click();
  await until('the camera is set to it', () => !v.stage.extent.equals(seen));

  // Gravity upside down, then as it was; friction.
  slide('gravity', -5);
  await until('gravity', () => Math.abs(source.state.gravity[2] - 5) < 1e-9);
  await until('the refusal is gone', () => $('live-note').textContent === '');
  check('gravity is told', $('gravity-value').textContent.startsWith('−5'), $('gravity-value').textContent);
  $('play').click();
  const low = height(top);
  await until('all rises', () => height(top) > low + 0.5);
  slide('friction', 0.1);
  await until('friction', () => source.state.friction === 0.1 && $('friction-value').textContent === '0.1');
  slide('gravity', 9.8);
  await until('it falls again', () => source.state.gravity[2] < -9.7 && film.number('kinetic', film.frames - 1) > 0);

  // A body follows the pointer, and is let go.
  const held = [...Array(before).keys()].filter((i) => film.head.bodies.kind[i] === 'dynamic').at(-1);
  const box = $('view').getBoundingClientRect();
  let at = null;
  $('stage').setPointerCapture = () => {};
  const pointer = (type, target, [x, y]) => target.dispatchEvent(new PointerEvent(type, {clientX: x, clientY: y, button: 0, buttons: 1, pointerId: 7, bubbles: true}));
  await until('a body under the pointer', () => {
    const point = v.stage.camera.position.clone().fromArray(v.shown.frame.positions, 3 * held).project(v.stage.camera);
    at = [box.left + ((point.x + 1) / 2) * box.width, box.top + ((1 - point.y) / 2) * box.height];
    const eye = v.stage.camera.position.toArray();
    pointer('pointerdown', $('view'), at);
    if (!v.live.held) pointer('pointerup', $('view'), at);
    return v.live.held;
  });
  const eye = v.stage.camera.position.toArray(), {body} = v.live.held;
  const goal = [at[0] - 60, Math.max(at[1] - 120, box.top + 20)];
  pointer('pointermove', $('stage'), goal);
  check('a rope is drawn', v.live.rope.visible);
  const end = () => v.live.held.at.clone().applyQuaternion(v.stage.camera.quaternion.clone().fromArray(v.shown.frame.rotations, 4 * body))
    .add(v.live.held.to.clone().fromArray(v.shown.frame.positions, 3 * body));
  await until('the body comes to the pointer', () => end().distanceTo(v.live.held.to) < 0.1);
  check('the camera stays', v.stage.camera.position.toArray().every((x, k) => x === eye[k]), eye);
  const lifted = height(body);
  pointer('pointerup', $('stage'), goal);
  await until('it is let go and falls', () => !v.live.held && !v.live.rope.visible && height(body) < lifted - 0.1);

  // What was is looked at while the run goes on.
  $('scrub').value = 2;
  $('scrub').dispatchEvent(new Event('input'));
  await until('scrubbed', () => v.shown.i === 2);
  const then = newest();
  await until('the run goes on', () => newest() > then + 10 && v.shown.i === 2 && $('clock-frame').textContent === `frame ${film.number('number', 2)} of ${newest()}`);
  const curve = v.curves[0].end;
  await until('the curves grow', () => v.curves[0].end > curve);
  press('End');
  await until('following', () => v.player.following && shown() > then);

  // What there is too much of is thinned, and can be looked at.
  const frames = film.frames, letters = source.letters, {texts} = source;
  source.thin();
  check('a quarter is gone', film.frames <= 0.76 * frames + 1 && film.number('number', 0) === 0, [frames, film.frames]);
  check('so are its texts', source.letters < letters && texts.size === film.frames, [letters, source.letters, texts.size]);
  check('letters are counted', source.letters === [...texts.values()].flat().reduce((sum, text) => sum + text.length, 0), source.letters);
  for (let k = 0; k < 5; ++k) {
    v.player.go(3 * k);
    await until(`frame ${3 * k} after that`, () => v.shown.i === 3 * k);
  }
  const last = newest();
  press('End');
  await until('it follows after that', () => v.player.following && shown() > last);
  press('r');
  check('the report', /Steps.*Awake, frozen/.test($('report').textContent) && !/State hash/.test($('report').textContent), $('report').textContent);

  // A stream that breaks off is taken up again.
  await fetch('drop', {method: 'POST'});
  await until('what is lost is told', () => /does not answer/.test($('live-note').textContent));
  const lost = newest();
  await until('and found', () => $('live-note').textContent === '' && newest() > lost);
  const numbers = film.numbers.get('number');
  check('each frame is there once', numbers.every((n, i) => i === 0 || n > numbers[i - 1]), numbers);
  const gaps = numbers.slice(numbers.indexOf(lost)).map((n, i, from) => n - (from[i - 1] ?? n));
  check('what was missed came, too', Math.max(...gaps) < 90, gaps);  // three seconds are 180

  // Loaded anew it has all of the run again.
  sessionStorage.setItem('beforeReload', JSON.stringify({found, last: newest(), bodies: bodies()}));
  location.reload();
  await new Promise(() => {});

  async function afterReload(then) {
    Object.assign(found, then.found);
    await until('all frames are there again', () => newest() >= then.last && film.number('number', 0) === 0);
    check('and no empty page before', film.frames > 100, film.frames);
    check('with all bodies', bodies() === then.bodies, [bodies(), then.bodies]);
    await until('it shows the present', () => v.player.following && shown() >= then.last);
    await until('the curves begin at the beginning', () => v.curves[0].end > 1);
    $('scrub').value = 1;
    $('scrub').dispatchEvent(new Event('input'));
    await until('the beginning can be looked at', () => shown() <= 2);
    check('where no ball was yet', v.shown.frame.frozen.length < then.bodies, v.shown.frame.frozen.length);
    press('End');
    await until('the run goes on', () => v.player.following && shown() > then.last);

    // Its end is told, and what was is still there.
    await fetch('end', {method: 'POST'});
    await until('the end is told', () => $('live-note').textContent === 'The run has ended.' && $('throw').disabled);
    press('Home');
    await until('the beginning', () => shown() === 0);
  }
});
