// Runs inside of a page of the viewer: clicks what a person would click and looks at what comes of it. See browser_test.py.
driver.drive(async () => {
  const $ = (id) => document.getElementById(id), {found, check, pause, until, press} = driver;
  const v = window.islet, last = v.film.frames - 1;
  const shown = () => v.shown?.i;
  await until('a frame is shown', () => v.shown !== null);
  await pause(100);
  found.heading = {heading: $('scene').textContent, tab: document.title, hint: $('scene').title, about: $('about').textContent, path: $('path').textContent};
  found.opened = {frame: v.player.frame, report: !$('report').hidden, command: $('command').textContent, picked: v.picked};
  const accuracy = [...v.film.numbers.get('accuracy')];
  found.opened.worst = accuracy.indexOf(Math.max(...accuracy));
  v.pick(-1);
  found.drawn = v.bodies.drawn;
  found.walls = v.walls.parts.length;
  found.background = getComputedStyle($('stage')).backgroundColor;
  check('no sideways scrolling', document.documentElement.scrollWidth <= window.innerWidth, document.documentElement.scrollWidth);
  check('six charts', document.querySelectorAll('#curves canvas').length === 6);

  // Frames.
  $('first').click();
  await until('first', () => shown() === 0);
  check('label', $('clock-frame').textContent === `frame 0 of ${last}`, $('clock-frame').textContent);
  $('forward').click();
  await until('a step on', () => shown() === 1);
  $('forward').click();
  await until('two steps on', () => shown() === 2);
  $('back').click();
  await until('a step back', () => shown() === 1);
  const middle = Math.round(last / 2);
  $('scrub').value = middle;
  $('scrub').dispatchEvent(new Event('input'));
  await until('scrubbed', () => shown() === middle);
  check('label after scrubbing', $('clock-frame').textContent === `frame ${middle} of ${last}`, $('clock-frame').textContent);
  check('clock', Math.abs(parseFloat($('clock-time').textContent) - v.film.number('time', middle)) < 0.006, $('clock-time').textContent);
  press('ArrowRight');
  await until('arrow key', () => shown() === middle + 1);
  press('ArrowLeft', {shiftKey: true});
  await until('ten back', () => shown() === middle - 9);
  press('End');
  await until('End', () => shown() === last);
  press('Home');
  await until('Home', () => shown() === 0);
  $('play').click();
  check('plays', v.player.playing && $('play').getAttribute('aria-label') === 'Pause');
  await until('playing moves on', () => shown() >= 3);
  press(' ');
  const stopped = v.player.frame;
  await pause(300);
  check('pause', !v.player.playing && v.player.frame === stopped, [stopped, v.player.frame]);
  $('speed').value = '4';
  $('speed').dispatchEvent(new Event('change'));
  check('speed', v.player.speed === 4);
  $('speed').focus();
  window.dispatchEvent(new PointerEvent('pointerdown'));
  $('speed').dispatchEvent(new Event('change'));
  check('a speed chosen by mouse leaves the keys', document.activeElement !== $('speed'));
  press('-');
  check('slower', v.player.speed === 2 && $('speed').value === '2');

  // Poses: bodies are where the frames say, and the picture has them there.
  v.player.go(last);
  await until('the last frame', () => shown() === last);
  const frame = v.shown.frame, first = await v.film.frame(0, false), dynamic = v.film.head.bodies.kind.map((k, i) => [k, i]).filter(([k]) => k === 'dynamic').map(([, i]) => i);
  check('bodies moved', dynamic.some((i) => Math.abs(frame.positions[3 * i + 2] - first.positions[3 * i + 2]) > 0.1));
  check('rotations are of length one', dynamic.every((i) => Math.abs(Math.hypot(...frame.rotations.subarray(4 * i, 4 * i + 4)) - 1) < 1e-5));
  const gl = v.stage.renderer.getContext();
  const project = (body) => {
    const point = v.stage.camera.position.clone().fromArray(frame.positions, 3 * body).project(v.stage.camera);
    return [(point.x + 1) / 2, (point.y + 1) / 2];
  };
  const pixel = ([x, y]) => {
    const out = new Uint8Array(4);
    gl.readPixels(Math.floor(x * gl.drawingBufferWidth), Math.floor(y * gl.drawingBufferHeight), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
    return [...out];
  };
  const far = (a, b) => Math.max(...a.map((x, k) => Math.abs(x - b[k])));
  v.draw(true);
  const empty = pixel([0.02, 0.98]), all = dynamic.map((i) => pixel(project(i)));
  check('pixels of bodies', all.every((p) => far(p, empty) > 12), [empty, all.filter((p) => far(p, empty) <= 12)]);
  v.bodies.group.visible = false;
  v.draw(true);
  const without = dynamic.map((i) => pixel(project(i)));
  v.bodies.group.visible = true;
  check('they are of the bodies', all.filter((p, k) => far(p, without[k]) > 12).length > 0.9 * all.length, [all, without]);

  // Plain pictures of what moves, and fine ones of what stands still.
  const draw = v.draw.bind(v), shadows = [];
  v.draw = (still) => {
    draw(still);
    shadows.push(v.stage.sun.castShadow);
  };
  v.dirty = true;
  await until('plain, and fine once it stands still', () => shadows.length > 1 && !shadows[0] && shadows.at(-1));
  delete v.draw;
  check('drawn by the CPU, it is plain in motion', $('show-plain').checked && v.plain);
  const fine = gl.drawingBufferWidth;
  v.draw(false);
  const plain = dynamic.map((i) => pixel(project(i)));
  check('plain: fewer pixels, no shadows', gl.drawingBufferWidth < fine && !v.stage.sun.castShadow, [gl.drawingBufferWidth, fine]);
  check('plain: other meshes', v.bodies.meshes.every((mesh) => !mesh.visible) && v.bodies.merged.length === v.bodies.meshes.length);
  check('plain: pixels of bodies', plain.filter((p, k) => far(p, without[k]) > 12).length > 0.9 * all.length, [plain, without]);
  // Shadows darken, so the picture is like the fine one, not the same.
  check('plain: like the fine ones', plain.filter((p, k) => far(p, all[k]) < 90).length > 0.7 * all.length, [plain, all]);
  press('m');
  check('fine in motion', !$('show-plain').checked && !v.plain);
  v.draw(false);
  check('fine in motion: shadows', v.stage.sun.castShadow && v.bodies.meshes.every((mesh) => mesh.visible));
  $('show-plain').click();
  check('plain again', v.plain);

  // Colours.
  const colours = new Set();
  for (const mode of v.modes) {
    $(`colour-${mode.id}`).click();
    await until(`colour ${mode.id}`, () => v.mode === mode && (!mode.contacts || frame.contacts));
    await pause(60);
    colours.add(v.bodies.meshes.map((mesh) => [...mesh.instanceColor.array].map((x) => x.toFixed(2)).join()).join());
    check(`legend of ${mode.id}`, mode.id === 'body' || $('legend').textContent.length > 5, $('legend').textContent);
  }
  check('every mode has its colours', colours.size === v.modes.length, colours.size);
  press('1');
  check('key of a colour', $('colour-body').checked);

  // Contacts.
  for (const name of ['points', 'normals', 'forces']) {
    $(`show-${name}`).click();
    await until(`${name} are drawn`, () => v.marks.drawn[name] === frame.contacts?.count && frame.contacts.count > 0);
    $(`show-${name}`).click();
    await until(`${name} are gone`, () => v.marks.drawn[name] === 0);
  }
  check('contacts of the page', frame.contacts.count === v.film.head.contacts.kept || frame.contacts.count > 3, frame.contacts.count);
  press('b');
  check('translucent', v.bodies.meshes[0].material.transparent);
  press('b');
  check('solid', !v.bodies.meshes[0].material.transparent);

  // Picking: a click on the middle of a body; on the nearest to the eye that no longer body hides.
  const box = $('view').getBoundingClientRect();
  const eye = v.stage.camera.position, away = (i) => eye.distanceTo(eye.clone().fromArray(frame.positions, 3 * i));
  $('view').setPointerCapture = $('view').releasePointerCapture = () => {};
  let wanted = -1;
  for (const i of [...dynamic].sort((a, b) => away(a) - away(b)).slice(0, 5)) {
    const [px, py] = project(i);
    const at = {clientX: box.left + px * box.width, clientY: box.top + (1 - py) * box.height, button: 0, pointerId: 1, bubbles: true};
    $('view').dispatchEvent(new PointerEvent('pointerdown', at));
    $('view').dispatchEvent(new PointerEvent('pointerup', at));
    for (let k = 0; k < 25 && v.picked !== i; ++k) await pause(20);
    if (v.picked === i) wanted = i;
    if (wanted >= 0) break;
  }
  check('picked', wanted >= 0);
  await until('its numbers', () => /Mass.*kg.*Position.*Speed.*m\/s.*Island.*Contacts/.test($('picked-body').textContent));
  check('its halo', v.bodies.halo.visible);
  press('Escape');
  check('nothing picked', v.picked === -1 && !v.bodies.halo.visible);

  // Charts: a click scrubs.
  const chart = document.querySelector('[data-plot="energy"] canvas'), area = chart.getBoundingClientRect();
  chart.setPointerCapture = () => {};
  chart.dispatchEvent(new PointerEvent('pointerdown', {clientX: area.left + 46 + (area.width - 54) / 4, clientY: area.top + 30, pointerId: 2, bubbles: true}));
  await until('a click in a chart', () => Math.abs(shown() - last / 4) <= 1);
  const inked = document.querySelectorAll('#curves canvas');
  for (const canvas of inked) {
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let ink = 0;
    for (let k = 3; k < data.length; k += 4) ink += data[k] > 0;
    check('a chart is drawn', ink > 300, ink);
  }

  // Camera, size, report.
  v.stage.camera.position.multiplyScalar(3);
  v.stage.controls.update();
  const moved = v.stage.camera.position.clone();
  $('camera').click();
  check('camera is reset', v.stage.camera.position.distanceTo(moved) > 1);
  $('stage').style.height = '321px';
  await until('the picture follows its size', () => v.stage.renderer.domElement.height === Math.floor(321 * v.stage.renderer.getPixelRatio()));
  $('stage').style.height = '';
  if ($('report').hidden) press('r');
  check('report', !$('report').hidden && $('report-button').getAttribute('aria-expanded') === 'true');
  found.report = $('report').textContent;
  check('the command is to be seen', !$('again').hidden && $('not-again').hidden);
  const unsolved = v.film.numbers.get('unsolved'), told = unsolved.every((n) => n >= 0);
  check('problems that failed', told ? found.report.includes(`Problems that failed${unsolved.reduce((a, b) => a + b, 0)}`) : !/that failed/.test(found.report), found.report);
  check('command', $('command').textContent.startsWith('islet run '), $('command').textContent);
});
