"""How long a page takes to open, and a frame of it, in a headless browser that draws with the CPU.

    python3 tests/scenes/viewer/browser_measure.py chromium cubeglass.html
"""
import json
import os
import sys
import tempfile

from browser import Browser, text_of

CHROMIUM, PAGE = sys.argv[1:3]
with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
    browser = Browser(CHROMIUM, scratch)
    copy = os.path.join(scratch, 'page.html')
    with open(copy, 'w', encoding='utf-8') as out:
        out.write(browser.with_script(text_of(PAGE), 'browser_measure.js'))
    answer, _ = browser.open('file://' + copy)
if not answer:
    sys.exit(f'{PAGE}: nothing was measured')
print(f'size {os.path.getsize(PAGE) / 1e6:.1f} MB')
for name, value in json.loads(answer).items():
    print(f'{name}: {value:.3g}')
