"""How long a page takes to open, and a frame of it, in a headless browser that draws with the CPU.

    python3 tests/scenes/viewer/browser_measure.py chromium cubeglass.html
"""
import http.server
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading

CHROMIUM, PAGE = sys.argv[1:3]
SCRIPT = '''<script>(async () => {
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
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
  draws.length = 0;
  v.player.show = timed(shows, (i) => v.show(i));
  v.player.play();
  await pause(8000);
  v.player.pause();
  found['frames a second, drawn'] = draws.length / 8;
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
  await fetch('http://127.0.0.1:PORT', {method: 'POST', mode: 'no-cors', body: JSON.stringify(found)});
})()</script>'''
answered, answer = threading.Event(), []


class Answers(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        answer.append(self.rfile.read(int(self.headers['Content-Length'])).decode())
        self.send_response(204)
        self.end_headers()
        answered.set()

    def log_message(self, *_):
        pass


server = http.server.HTTPServer(('127.0.0.1', 0), Answers)
threading.Thread(target=server.serve_forever, daemon=True).start()
text = open(PAGE, encoding='utf-8').read()
end = text.rindex('</body>')
with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
    copy = os.path.join(scratch, 'page.html')
    with open(copy, 'w', encoding='utf-8') as out:
        out.write(text[:end] + SCRIPT.replace('PORT', str(server.server_port)) + text[end:])
    browser = subprocess.Popen(
        [CHROMIUM, '--headless', '--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader', '--remote-debugging-port=0',
         f'--user-data-dir={scratch}/profile', '--window-size=1280,900', 'file://' + copy],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    answered.wait(120)
    os.killpg(browser.pid, signal.SIGKILL)
    browser.wait()
if not answer:
    sys.exit(f'{PAGE}: nothing was measured')
print(f'size {os.path.getsize(PAGE) / 1e6:.1f} MB')
for name, value in json.loads(answer[0]).items():
    print(f'{name}: {value:.3g}')
