#!/usr/bin/env bash
# Makes a site of the pages, by MkDocs, and fails for a link between them that leads nowhere.
#
#   scripts/site.sh           target/site: static files for any server
#   scripts/site.sh --serve   and serves them on http://localhost:8000
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

folder=${CARGO_TARGET_DIR:-$PWD/target}/site
rm -rf "$folder"
mkdir -p "$folder/pages"
[[ -x $folder.env/bin/mkdocs ]] || python3 -m venv "$folder.env"
"$folder.env/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade "mkdocs>=1.6,<2"

# The README is the first page. Links to other files of the repository stay behind as text.
cp -r docs/. "$folder/pages"
rm "$folder/pages/farm.sbatch"
cp .github/CONTRIBUTING.md "$folder/pages/contributing.md"
sed -E 's,(\(|src=")docs/,\1,g' README.md >"$folder/pages/index.md"
sed -E -i 's,\((\.\./)?\.github/CONTRIBUTING\.md,(contributing.md,g; s,\((\.\./)?docs/,(,g; s,\(\.\./README\.md,(index.md,g' "$folder"/pages/*.md
sed -E -i 's,\[([^]]+)\]\((\.\./[^)]*|(crates|src|scripts|sims|tests|python|benches|shaders)/[^)]*|[A-Z-]+(\.md)?|farm\.sbatch)\),\1,g' \
    "$folder"/pages/*.md
cat >"$folder/mkdocs.yml" <<'YAML'
site_name: limpid
docs_dir: pages
site_dir: html
theme:
  name: readthedocs
validation:
  anchors: warn
nav:
  - First picture: index.md
  - Scenes: scenes.md
  - Files of other tools: strangers.md
  - Simulations: simulations.md
  - The window: playback.md
  - Films and farms: farms.md
  - Frame tests: check.md
  - Python: python.md
  - In the browser: web.md
  - In your program's frame: hosts.md
  - Accuracy: accuracy.md
  - Caustics: caustics.md
  - Radius: radius.md
  - Speed: speed.md
  - Devices: devices.md
  - Damaged files: hostile.md
  - Gallery: gallery.md
  - How it works: architecture.md
  - Contributing: contributing.md
YAML
"$folder.env/bin/mkdocs" build --quiet --strict --config-file "$folder/mkdocs.yml"
echo "site: $folder/html"
[[ ${1-} != --serve ]] || exec python3 -m http.server --bind localhost --directory "$folder/html" "${PORT:-8000}"
