"""Pages in headless Chromium: each is loaded in a frame as wide as a phone, from a server of this computer."""
import contextlib
import functools
import html
import http.server
import json
import re
import shutil
import subprocess
import threading

# Loads one page after the other, and replaces itself with what it finds: {page: {...}}, as JSON.
SURVEY = """<!DOCTYPE html><link rel="icon" href="data:,"><body><script>
const pages = %s, found = {};
async function load(page) {
  const frame = document.createElement('iframe');
  frame.width = %d; frame.height = 800;
  document.body.append(frame);
  await new Promise(done => { frame.onload = done; frame.src = '/' + page; });
  const inside = frame.contentDocument;
  if (page.includes('?q=')) {
    while (!inside.querySelector('#search-results li')) await new Promise(done => setTimeout(done, 50));
  }
  found[page] = {
    excess_px: inside.documentElement.scrollWidth - inside.documentElement.clientWidth,
    links: Array.from(inside.links, link => link.href.replace(location.origin + '/', '')),
    ids: Array.from(inside.querySelectorAll('[id]'), element => element.id),
    empty_images: Array.from(inside.images).filter(image => !image.naturalWidth).map(image => image.src),
    results: inside.querySelectorAll('#search-results li').length};
  frame.remove();
}
(async () => {
  for (const page of pages) await load(page);
  document.body.textContent = JSON.stringify(found);
})();
</script>"""


class _Handler(http.server.SimpleHTTPRequestHandler):
    """Serves a folder and the survey, and keeps the paths that it does not have."""

    def __init__(self, survey, missing, *arguments, **options):
        self._survey, self._missing = survey, missing
        super().__init__(*arguments, **options)

    def do_GET(self):
        if self.path != '/survey':
            super().do_GET()
            return
        self.send_response(200)
        self.end_headers()
        self.wfile.write(self._survey.encode())

    def send_error(self, code, *_texts, **_options):
        self._missing.append(self.path)
        super().send_error(code)

    def log_message(self, *_arguments):
        pass


@contextlib.contextmanager
def _server(folder, survey, missing):
    handler = functools.partial(_Handler, survey, missing, directory=folder)
    server = http.server.ThreadingHTTPServer(('localhost', 0), handler)
    server.handle_error = lambda *_arguments: None  # the browser may close a connection early
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield 'http://localhost:%d' % server.server_port
    finally:
        server.shutdown()
        server.server_close()


def survey(folder, pages, width_px, timeout_s=120):
    """Load pages of a folder, given by their paths and queries, in frames of a width.

    Returns {page: {'excess_px': width that can be scrolled, 'links', 'ids', 'empty_images': URLs, 'results': number}},
    messages on the console, and paths that were requested and do not exist.
    """
    missing = []
    with _server(folder, SURVEY % (json.dumps(pages), width_px), missing) as address:
        result = subprocess.run(
            [shutil.which('chromium') or 'chromium', '--headless', '--no-sandbox', '--disable-gpu',
             '--disable-dev-shm-usage', '--dump-dom', '--enable-logging=stderr',
             '--virtual-time-budget=%d' % (1000 * timeout_s), address + '/survey'],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=timeout_s, universal_newlines=True)
    console = re.findall(r'CONSOLE.*', result.stderr)
    text = re.search(r'<body>(\{.*\})</body>', result.stdout, re.DOTALL)
    if text is None:
        raise AssertionError('no survey: %s\n%s' % (result.stdout[-500:], result.stderr[-2000:]))
    return json.loads(html.unescape(text.group(1))), console, missing
