"""Opens the page of `islet view --live` in a browser and plays with the run as a person would.

    live_test.py islet chromium scratch

live_drive.js does the clicking. It comes into the page by a server of this test that stands between: what it passes on is the engine's.
"""
import http.client
import http.server
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request

from browser import Browser

ISLET, CHROMIUM, SCRATCH = sys.argv[1:4]
shutil.rmtree(SCRATCH, ignore_errors=True)
os.makedirs(SCRATCH)
browser = Browser(CHROMIUM, SCRATCH)
# A stack on a floor, and a wall between it and the eye.
scene = os.path.join(SCRATCH, 'scene.json')
with open(scene, 'w', encoding='utf-8') as file:
    json.dump({'version': 1, 'time': {'dt': 1 / 60}, 'bodies': [
        {'name': 'floor', 'shape': {'type': 'half_space'}, 'kind': 'fixed'},
        {'name': 'wall', 'shape': {'type': 'box', 'size': [9, 0.5, 9]}, 'kind': 'fixed', 'position': [0, -4, 4.5]},
        {'name': 'cube', 'shape': {'type': 'box', 'size': [1, 1, 1]}, 'density': 2700, 'position': [0, 0, 0.7], 'stack': {'count': 4, 'step': [0, 0, 1.2]}},
    ]}, file)
program = subprocess.Popen([ISLET, 'view', scene, '--threads', '1', '--live'],
                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
address = re.fullmatch(r'page +(http://127\.0\.0\.1:\d+)(/\w{32}/)\n', program.stdout.readline())
if not address:
    sys.exit(f'islet tells no address: {program.communicate()[1]}')
ISLET_AT, PATH = address.groups()


dropped = threading.Event()


class Between(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        seen = {'Last-Event-ID': self.headers['Last-Event-ID']} if self.headers['Last-Event-ID'] else {}
        with urllib.request.urlopen(urllib.request.Request(ISLET_AT + self.path, headers=seen)) as answer:
            self.send_response(200)
            self.send_header('Content-Type', answer.headers['Content-Type'])
            self.end_headers()
            if self.path == PATH:
                self.wfile.write(browser.with_script(answer.read().decode(), 'live_drive.js').encode())
                return
            try:
                while not dropped.is_set() and (piece := answer.read1(65536)):
                    self.wfile.write(piece)
                dropped.clear()
            except (OSError, http.client.HTTPException):  # the browser or the run is gone
                pass

    def do_POST(self):
        message = self.rfile.read(int(self.headers['Content-Length']))
        status, text = 204, b''
        if self.path == PATH + 'end':
            program.send_signal(signal.SIGINT)
        elif self.path == PATH + 'drop':
            dropped.set()
        else:
            try:
                urllib.request.urlopen(ISLET_AT + self.path, message).close()
            except urllib.error.HTTPError as error:
                status, text = error.code, error.read()
        self.send_response(status)
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, *_):
        pass


server = http.server.ThreadingHTTPServer(('127.0.0.1', 0), Between)
threading.Thread(target=server.serve_forever, daemon=True).start()
try:
    answer, console = browser.open(f'http://127.0.0.1:{server.server_port}{PATH}', 1280, 900)
    _, errors = program.communicate(timeout=30) if answer else program.communicate(program.kill())
finally:
    program.kill()
if answer is None:
    sys.exit(f'the script in the page did not end; console:\n{console[-3000:]}\n{errors}')
found = json.loads(answer)
# What the script provokes stands there, too: a refusal, and a stream that breaks off.
provoked = 'status of 400', 'ERR_INCOMPLETE_CHUNKED_ENCODING'
messages = [line for line in console.splitlines() if 'CONSOLE' in line and not any(text in line for text in provoked)]
failures = found['problems'] + found['complaints'] + messages
if found['message']:
    failures.append(found['message'])
if found['checks'] < 40:
    failures.append(f"{found['checks']} checks were made")
if program.returncode != 130:
    failures.append(f'islet ended with {program.returncode}: {errors}')
if failures:
    sys.exit('\n'.join(failures))
print('the page plays with the run')
