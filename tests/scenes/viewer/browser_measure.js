// Times what a page does while it plays, see browser_measure.py.
(async () => {
  const {pause, send} = driver;
  const median = (list) => list.sort((a, b) => a - b)[list.length >> 1];
  const timed = (list, work) => (...given) => {
    const began = performance.now(), result = work(...given);
    list.push(performance.now() - began);
    return result;
  };
  while (document.getElementById('message').textContent !== '') await pause(5);
  const found = {'open [ms]': performance.now()}, v = window.islet, shows = [], draws = [], marked = [];
  v.stage.render = timed(draws, v.stage.render.bind(v.stage));
  v.player.go(Math.round(v.film.frames / 10));
  await pause(500);
  v.player.show = timed(shows, (i) => v.show(i));
  // At four times the speed no film has fewer frames than can be drawn.
  for (const [name, plain, speed] of [['in full', false, 1], ['plainly', true, 1], ['plainly, at speed 4', true, 4]]) {
    v.setToggle('plain', plain);
    v.player.setSpeed(speed);
    v.player.play();
    await pause(1000);
    draws.length = 0;
    const began = performance.now();
    while (performance.now() < began + 6000 && v.player.playing) await pause(50);
    found[`frames a second drawn ${name}`] = (1e3 * draws.length) / (performance.now() - began);
    v.player.pause();
    v.player.go(Math.round(v.film.frames / 10));
    await pause(500);
  }
  found['script a frame, poses and colours [ms]'] = median(shows);
  found['script a frame, drawing [ms]'] = median(draws);
  v.setToggle('forces', true);
  v.setToggle('points', true);
  v.setMode('impulse');
  const middle = Math.round(v.film.frames / 3);
  for (let i = middle; i < Math.min(middle + 40, v.film.frames); ++i) {
    await v.film.frame(i, true);
    timed(marked, () => v.player.go(i))();
    await pause(10);
  }
  found['script a frame, with points, forces and impulse, without drawing [ms]'] = median(marked);
  await send(found);
})();
