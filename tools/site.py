"""Look at every page of the built documentation in Chromium: accessibility by axe-core, and width on a telephone.

    npm pack axe-core && tar xf axe-core-*.tgz
    python tools/site.py docs/_build/html --axe package/axe.min.js

Each page is shown 1280 and 390 pixels wide, in light and dark.  Exit code 1 if axe finds anything, if a page is wider
than the screen, or if it asks for anything from another host.
"""

from __future__ import annotations

import argparse
import functools
import html
import json
import re
import subprocess
import sys
import threading
from collections import defaultdict
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

PROBE = """<!doctype html><html lang="en"><title>probe</title><body style="margin:0">
<iframe id="page" width="{width}" height="1200" style="border:0"></iframe><pre id="found"></pre>
<script>
localStorage.setItem("mode", "{theme}");
localStorage.setItem("theme", "{theme}");
const page = document.getElementById("page");
page.onload = async () => {{
  const inside = page.contentWindow;
  const script = inside.document.createElement("script");
  script.src = "/axe.min.js";
  script.onload = async () => {{
    const found = await inside.axe.run(inside.document, {{resultTypes: ["violations"]}});
    const lines = found.violations.flatMap(v => v.nodes.map(n => v.id + ": " + n.html.slice(0, 160)));
    const wide = inside.document.documentElement.scrollWidth;
    if (wide > {width}) lines.push("wide: " + wide + " pixels");
    for (const got of inside.performance.getEntriesByType("resource"))
      if (!got.name.startsWith(location.origin)) lines.push("elsewhere: " + got.name);
    document.getElementById("found").textContent = "FOUND" + JSON.stringify(lines) + "END";
  }};
  inside.document.head.append(script);
}};
page.src = "/{page}";
</script></body></html>"""


class Pages(SimpleHTTPRequestHandler):
    """The site, axe-core, and a probe page per page, width and theme."""

    axe = b""

    def do_GET(self) -> None:
        """Answer for axe-core and probes; files otherwise."""
        if self.path == "/axe.min.js":
            return self._send(self.axe, "text/javascript")
        if self.path.startswith("/probe/"):
            _, _, width, theme, page = self.path.split("/", 4)
            return self._send(PROBE.format(page=page, width=width, theme=theme).encode(), "text/html")
        return super().do_GET()

    def _send(self, body: bytes, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *arguments: object) -> None:
        """Say nothing of each request."""


def look(chromium: str, address: str) -> list[str]:
    """Problems of a page, by its probe."""
    command = [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=60000", "--dump-dom"]
    size = "--window-size=1400,1300"
    dom = subprocess.run([*command, size, address], capture_output=True, text=True, timeout=180, check=True).stdout
    found = re.search(r"FOUND(\[.*?\])END", dom, re.S)
    return json.loads(html.unescape(found[1])) if found else ["the page did not load"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the built site")
    parser.add_argument("--axe", type=Path, required=True, help="axe.min.js of the npm package axe-core")
    parser.add_argument("--chromium", default="chromium")
    parser.add_argument("--pages", default="**/*.html", help="a pattern; all of them")
    options = parser.parse_args()
    Pages.axe = options.axe.read_bytes()
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Pages, directory=str(options.folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    root = f"http://127.0.0.1:{server.server_port}/probe"
    problems = defaultdict(list)
    pages = sorted(str(p.relative_to(options.folder)) for p in options.folder.glob(options.pages))
    pages = [page for page in pages if not page.startswith(("_", "genindex", "py-modindex", "search"))]
    for page in pages:
        for width, theme in ((1280, "light"), (390, "light"), (1280, "dark")):
            for problem in look(options.chromium, f"{root}/{width}/{theme}/{page}"):
                problems[problem].append(f"{page} ({width}, {theme})")
    for problem, where in sorted(problems.items()):
        print(f"{problem}\n    {len(where)} times, first on {where[0]}")
    print(f"{len(pages)} pages, {len(problems)} problems")
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
