"""A headless browser for what is beside this file: it opens a page that has a script inside, and waits for what the script sends."""
import http.server
import os
import signal
import subprocess
import threading

HERE = os.path.dirname(os.path.abspath(__file__))


def text_of(path):
    with open(path, encoding='utf-8') as file:
        return file.read()


class Browser:
    """scratch: a folder for its own files, and for the console's."""

    def __init__(self, chromium, scratch):
        self.chromium, self.scratch = chromium, scratch
        self.answered, self.answer = threading.Event(), None
        browser = self

        class Answers(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                browser.answer = self.rfile.read(int(self.headers['Content-Length'])).decode()
                self.send_response(204)
                self.end_headers()
                browser.answered.set()

            def log_message(self, *_):
                pass

        self.server = http.server.HTTPServer(('127.0.0.1', 0), Answers)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def with_script(self, page, name):
        """The text of a page with browser_tools.js at its beginning and the script of that name at its end."""
        tools = text_of(os.path.join(HERE, 'browser_tools.js')).replace('PORT', str(self.server.server_port))
        head, end = page.index('<style>'), page.rindex('</body>')
        return f'{page[:head]}<script>{tools}</script>{page[head:end]}<script>{text_of(os.path.join(HERE, name))}</script>{page[end:]}'

    def open(self, address, width=1280, height=900, dark=False, seconds=120):
        """What the script sent, None if nothing; and what stands in the console."""
        self.answer = None
        self.answered.clear()
        log = os.path.join(self.scratch, 'console.txt')
        with open(log, 'w', encoding='utf-8') as console:
            browser = subprocess.Popen(
                [self.chromium, '--headless', '--no-sandbox', '--enable-unsafe-swiftshader', '--use-angle=swiftshader', '--enable-logging=stderr',
                 '--remote-debugging-port=0', f'--user-data-dir={self.scratch}/profile', f'--window-size={width},{height}',
                 f'--blink-settings=preferredColorScheme={0 if dark else 1}', address],
                stdout=subprocess.DEVNULL, stderr=console, start_new_session=True)
            self.answered.wait(seconds)
            os.killpg(browser.pid, signal.SIGKILL)
            browser.wait()
        with open(log, encoding='utf-8', errors='replace') as console:
            return self.answer, console.read()
