"""Opens pages in a browser, uses them as a person would, and compares what must be seen.

    browser_test.py islet test_scenes_viewer_page chromium scratch

browser_drive.js does the clicking inside of a copy of each page, and sends what it found.
Any message in the console fails.
"""
import json
import os
import re
import shutil
import subprocess
import sys

from browser import Browser, text_of

ISLET, PAGE_TEST, CHROMIUM, SCRATCH = sys.argv[1:5]
failures = []


def check(what, good, found=''):
    if not good:
        failures.append(f'{what}: {found}')


def run(*command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


def browse(page, width, height, dark=False, quiet=True):
    """What the script found, with the messages of the console."""
    copy = os.path.join(SCRATCH, 'driven.html')
    with open(copy, 'w', encoding='utf-8') as out:
        out.write(browser.with_script(text_of(page), 'browser_drive.js'))
    answer, console = browser.open('file://' + copy, width, height, dark, 90)
    if answer is None:
        sys.exit(f'{page}: the script in the page did not end; console:\n{console[-3000:]}')
    found = json.loads(answer)
    messages = [line for line in console.splitlines() if 'CONSOLE' in line]
    if quiet:
        check(f'console of {page} at {width} px', not messages, messages)
        check(f'errors in {page}', not found['complaints'], found['complaints'])
    return found


def head_of(page):
    return json.loads(re.search(r'id="head">(.*?)</script>', text_of(page)).group(1))


shutil.rmtree(SCRATCH, ignore_errors=True)
os.makedirs(SCRATCH)
browser = Browser(CHROMIUM, SCRATCH)
jam = os.path.join(SCRATCH, 'jam.html')
summary = run(ISLET, 'view', 'cubejam', '--count', '30', '--frames', '70', '--threads', '1', '--out', jam)
shapes = os.path.join(SCRATCH, 'shapes.html')
run(PAGE_TEST, '--gtest_filter=Page.HoldsTheFilm*', env={**os.environ, 'ISLET_PAGE': shapes})
worst = os.path.join(SCRATCH, 'worst.html')
run(ISLET, 'run', 'cubejam', '--count', '12', '--frames', '40', '--threads', '1', '--html', worst)
# Scenes from files: one with a title and the like, of its recording, and one without.
ball = {'version': 1, 'bodies': [{'name': 'floor', 'shape': {'type': 'half_space'}, 'kind': 'fixed'},
                                 {'name': 'ball', 'shape': {'type': 'sphere', 'radius': 0.5}, 'density': 1, 'position': [0, 0, 2]}]}
told, plain = os.path.join(SCRATCH, 'told.json'), os.path.join(SCRATCH, 'plain.json')
for name, more in (told, {'title': 'A <b>ball</b>', 'about': 'It falls & bounces.'}), (plain, {}):
    with open(name, 'w', encoding='utf-8') as file:
        json.dump(ball | more, file)
told_page, plain_page = os.path.join(SCRATCH, 'told.html'), os.path.join(SCRATCH, 'plain.html')
run(ISLET, 'run', told, '--frames', '60', '--record', os.path.join(SCRATCH, 'told.film'))
run(ISLET, 'view', os.path.join(SCRATCH, 'told.film'), '--out', told_page)
run(ISLET, 'view', plain, '--frames', '60', '--out', plain_page)

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
check('its heading', found['heading']['heading'] == 'cubejam' and found['heading']['path'] == '' != found['heading']['about'], found['heading'])
check('its command', found['opened']['command'] == 'islet run cubejam --count=12 --frames=40', found['opened'])
check('it opens at its worst frame', found['opened']['frame'] == found['opened']['worst'] > 0, found['opened'])
check('a body of the worst island is picked', found['opened']['picked'] >= 0, found['opened'])

# Its title is the heading, else the name of its file; the path is below.
for page, heading, about, path in [(told_page, 'A <b>ball</b>', 'It falls & bounces.', told), (plain_page, 'plain.json', '', plain)]:
    found = browse(page, 800, 600)
    check(f'heading of {page}', found['heading'] == {'heading': heading, 'tab': f'{heading} – islet', 'hint': path, 'about': about, 'path': path}, found['heading'])

# A page that was damaged says so.
text = text_of(jam)
at = text.index('id="bodies0">') + 200
broken = os.path.join(SCRATCH, 'broken.html')
open(broken, 'w', encoding='utf-8').write(text[:at] + 'AAAAAAAA' + text[at + 8:])
found = browse(broken, 800, 600, quiet=False)
check('message of a damaged page', found['message'].startswith('This page cannot be shown'), found)

if failures:
    sys.exit('\n'.join(failures))
print('the pages do what they should')
