// Makes bundle/page.html of page.html, style.css and src/: `npm ci --ignore-scripts && npm run bundle`, or the target `viewer`.
import {execFileSync} from 'node:child_process';
import {copyFileSync, mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const read = (name) => readFileSync(join(here, name), 'utf8');

const script = await build({
  entryPoints: [join(here, 'src/main.js')],
  bundle: true, minify: true, write: false, format: 'iife', target: 'es2022', legalComments: 'none', charset: 'ascii',
});
const style = await build({entryPoints: [join(here, 'style.css')], minify: true, write: false});
// As the test computes it, without npm.
const hash = execFileSync('cmake', ['-P', join(here, 'sources_hash.cmake')], {encoding: 'utf8'}).trim();
const licence = readFileSync(join(here, 'node_modules/three/LICENSE'), 'utf8');

const page = read('page.html')
  .replace('<!doctype html>', () => `<!doctype html>\n<!-- Made of scenes/viewer; sources ${hash}.\nHolds three.js:\n${licence.trim()}\n-->`)
  .replace('/*style*/', () => style.outputFiles[0].text.trim())
  .replace('/*script*/', () => script.outputFiles[0].text.trim());
mkdirSync(join(here, 'bundle'), {recursive: true});
writeFileSync(join(here, 'bundle/page.html'), page);
copyFileSync(join(here, 'node_modules/three/LICENSE'), join(here, 'bundle/LICENSE.three'));
console.log(`bundle/page.html: ${Math.round(page.length / 1024)} KiB, sources ${hash}`);
