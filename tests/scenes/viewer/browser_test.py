"""Opens pages in a browser, uses them as a person would, and compares what must be seen.

    browser_test.py islet test_scenes_viewer_page chromium scratch

browser_drive.js does the clicking inside of a copy of each page, and sends what it found to a server of this test, which takes nothing else.
Any message in the console fails.
"""
import http.server
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading

ISLET, PAGE_TEST, CHROMIUM, SCRATCH = sys.argv[1:5]
HERE = os.path.dirname(os.path.abspath(__file__))
failures = []
answered, answer = threading.Event(), None


class Answers(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        global answer
        answer = self.rfile.read(int(self.headers['Content-Length'])).decode()
        self.send_response(204)
        self.end_headers()
        answered.set()

    def log_message(self, *_):
        pass


server = http.server.HTTPServer(('127.0.0.1', 0), Answers)
threading.Thread(target=server.serve_forever, daemon=True).start()


def check(what, good, found=''):
    if not good:
        failures.append(f'{what}: {found}')


def run(*command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


def browse(page, width, height, dark=False, quiet=True):
    """What the script found, with the messages of the console."""
    text = open(page, encoding='utf-8').read()
    drive = open(os.path.join(HERE, 'browser_drive.js'), encoding='utf-8').read().replace('PORT', str(server.server_port))
    catch = "<script>window.complaints=[];addEventListener('error',e=>complaints.push(e.message));" \
            "addEventListener('unhandledrejection',e=>complaints.push(String(e.reason)))</script>"
    copy = os.path.join(SCRATCH, 'driven.html')
    end = text.rindex('</body>')
    head = text.index('<style>')
    with open(copy, 'w', encoding='utf-8') as out:
        out.write(text[:head] + catch + text[head:end] + f'<script>{drive}</script>' + text[end:])
    global answer
    answer = None
    answered.clear()
    log = os.path.join(SCRATCH, 'console.txt')
    with open(log, 'w', encoding='utf-8') as console:
        browser = subprocess.Popen(
            [CHROMIUM, '--headless', '--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader', '--enable-logging=stderr',
             '--remote-debugging-port=0', f'--user-data-dir={SCRATCH}/profile', f'--window-size={width},{height}',
             f'--blink-settings=preferredColorScheme={0 if dark else 1}', 'file://' + copy],
            stdout=subprocess.DEVNULL, stderr=console, start_new_session=True)
        answered.wait(90)
        os.killpg(browser.pid, signal.SIGKILL)
        browser.wait()
    console = open(log, encoding='utf-8', errors='replace').read()
    if answer is None:
        sys.exit(f'{page}: the script in the page did not end; console:\n{console[-3000:]}')
    found = json.loads(answer)
    messages = [line for line in console.splitlines() if 'CONSOLE' in line]
    if quiet:
        check(f'console of {page} at {width} px', not messages, messages)
        check(f'errors in {page}', not found['complaints'], found['complaints'])
    return found


def head_of(page):
    return json.loads(re.search(r'id="head">(.*?)</script>', open(page, encoding='utf-8').read()).group(1))


shutil.rmtree(SCRATCH, ignore_errors=True)
os.makedirs(SCRATCH)
jam = os.path.join(SCRATCH, 'jam.html')
summary = run(ISLET, 'view', 'cubejam', '--count', '30', '--frames', '70', '--threads', '1', '--out', jam)
shapes = os.path.join(SCRATCH, 'shapes.html')
run(PAGE_TEST, '--gtest_filter=Page.HoldsTheFilm*', env={**os.environ, 'ISLET_PAGE': shapes})
worst = os.path.join(SCRATCH, 'worst.html')
run(ISLET, 'run', 'cubejam', '--count', '12', '--frames', '40', '--threads', '1', '--html', worst)

backgrounds = set()
for page, sizes in [(jam, [(400, 900, False), (2000, 1100, True)]), (shapes, [(1280, 900, False)])]:
    head = head_of(page)
    for width, height, dark in sizes:
        found = browse(page, width, height, dark)
        name = f'{os.path.basename(page)} at {width} px'
        for problem in found['problems']:
            failures.append(f'{name}: {problem}')
        check(f'{name}: checks made', found['checks'] >= 50, found['checks'])
        kinds = [(head['bodies']['kind'][i], head['shapes'][s]['kind']) for i, s in enumerate(head['bodies']['shape'])]
        dynamic = sum(kind == 'dynamic' for kind, _ in kinds)
        check(f'{name}: bodies drawn', dynamic <= found['drawn'] <= len(kinds), found['drawn'])
        check(f'{name}: drawn or walls', found['drawn'] + found['walls'] == len(kinds), found)
        backgrounds.add(found['background'])
        if page == jam:
            state = re.search(r'state hash +([0-9a-f]{16})', summary).group(1)
            check(f'{name}: state hash in the report', state in found['report'], found['report'])
check('colours of light and dark', len(backgrounds) == 2, backgrounds)

found = browse(worst, 1280, 900)
check('the report is open', found['opened']['report'], found['opened'])
check('its command', found['opened']['command'] == 'islet run cubejam --count=12 --frames=40', found['opened'])
check('it opens at its worst frame', found['opened']['frame'] == found['opened']['worst'] > 0, found['opened'])
check('a body of the worst island is picked', found['opened']['picked'] >= 0, found['opened'])

# A page that was damaged says so.
text = open(jam, encoding='utf-8').read()
at = text.index('id="bodies0">') + 200
broken = os.path.join(SCRATCH, 'broken.html')
open(broken, 'w', encoding='utf-8').write(text[:at] + 'AAAAAAAA' + text[at + 8:])
found = browse(broken, 800, 600, quiet=False)
check('message of a damaged page', found['message'].startswith('This page cannot be shown'), found)

if failures:
    sys.exit('\n'.join(failures))
print('the pages do what they should')
