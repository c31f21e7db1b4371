"""Write the pictures of the live page, light and dark, while the laboratory presses a ball.

python docs/images/make_live_pictures.py    # needs the extras browser and lab, and chromium
"""

import io
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

IMAGES = Path(__file__).parent
PORT = "8799"
ENDINGS = {"light": "", "dark": "-dark"}


def main() -> None:
    """Press the ball until there is a verdict, and take the picture of both schemes."""
    command = [sys.executable, "-m", "palpate", "live", "lab:ball", "--port", PORT, "--no-console"]
    live = subprocess.Popen(command)
    try:
        time.sleep(8.0)  # until the page answers
        with sync_playwright() as started:
            chromium = os.environ.get("CHROMIUM") or shutil.which("chromium")
            browser = started.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            pages = {}
            for scheme in ENDINGS:
                size = {"width": 1280, "height": 950}
                pages[scheme] = browser.new_page(viewport=size, color_scheme=scheme)
                pages[scheme].goto(f"http://127.0.0.1:{PORT}/")
            time.sleep(20.0)
            for scheme, ending in ENDINGS.items():
                picture = Image.open(io.BytesIO(pages[scheme].screenshot()))
                picture.quantize(64).save(IMAGES / f"live{ending}.png", optimize=True)
            browser.close()
    finally:
        live.terminate()
        live.wait(15.0)


if __name__ == "__main__":
    main()
