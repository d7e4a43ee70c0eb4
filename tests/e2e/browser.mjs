// Chromium for browser tests. Debian's own, found by path; the flags keep it from calling home.
import assert from 'node:assert/strict';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from 'playwright-core';

export const chromiumPath = process.env.ANCHORD_CHROMIUM ?? '/usr/bin/chromium';
export const haveChromium = existsSync(chromiumPath);

const flags = [
  '--no-sandbox',
  '--disable-gpu',
  '--disable-quic',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-sync',
  '--enable-unsafe-swiftshader',
];

/** A browser context with a profile of its own: {context, page, close()}. `options` go to Playwright's context. Less motion is asked for unless a
 * test says otherwise: the drone then moves ten times a second, and a page that only stands open leaves the processor to the tests beside it. */
export async function openBrowser(options = {}) {
  const profile = mkdtempSync(join(tmpdir(), 'anchord-chromium-'));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: chromiumPath,
    headless: true,
    args: flags,
    viewport: { width: 1440, height: 900 },
    reducedMotion: 'reduce',
    ...options,
  });
  const page = context.pages()[0] ?? (await context.newPage());
  return {
    context,
    page,
    async close() {
      await context.close();
      rmSync(profile, { recursive: true, force: true });
    },
  };
}

/** A page of `server` that notes its console errors and every host it asks: {page, seen, id(testid)}. */
export async function openPage(browser, server, { hash = '#/live', theme = 'light', width = 1440, height = 900 } = {}) {
  const page = await browser.context.newPage();
  await page.setViewportSize({ width, height });
  const seen = { errors: [], hosts: new Set() };
  page.on('console', (m) => m.type() === 'error' && seen.errors.push(m.text()));
  page.on('pageerror', (e) => seen.errors.push(String(e)));
  page.on('request', (r) => seen.hosts.add(new URL(r.url()).host));
  page.on('websocket', (w) => seen.hosts.add(new URL(w.url()).host));
  await page.goto(`${server.url}/?theme=${theme}${hash}`);
  return { page, seen, id: (name) => page.getByTestId(name) };
}

const shots = process.env.ANCHORD_SHOTS; // a folder: keep pictures of what was tested
export const picture = async (page, name) => {
  if (shots) await page.screenshot({ path: join(shots, `${name}.png`) });
};

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
/** What axe finds wrong on the page as it is, and whether it is wider than its window. `sizes`: of targets too, which a bar at the bottom may half cover.
 * `within`: a selector of the part that is looked at. */
export async function violations(page, { sizes = false, within = null } = {}) {
  if (!(await page.evaluate(() => 'axe' in globalThis))) await page.evaluate(axe); // it takes as long as a third of a look
  const found = await page.evaluate(
    ({ enabled, part }) =>
      globalThis.axe.run(part ?? document, { resultTypes: ['violations'], rules: { 'target-size': { enabled } } }),
    { enabled: sizes, part: within },
  );
  const [page_px, window_px] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  const sideways = page_px > window_px + 1 ? [`wider than its window: ${page_px} px in ${window_px}`] : [];
  return [...found.violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.target.join(' ')).join(', ')}`), ...sideways];
}

/** What a reader cannot read: text broken into letters, cut off with no dots, out of its button, and controls that lie on their neighbours. */
export const unreadable = (page) =>
  page.evaluate(() => {
    const found = [],
      name = (e) => {
        const near = e.closest('[data-testid]')?.dataset.testid ?? e.closest('[class]')?.className ?? e.tagName;
        return `${near}: "${(e.innerText ?? e.textContent).trim().replace(/\s+/g, ' ').slice(0, 40)}"`;
      },
      seen = (e) =>
        e.checkVisibility({ visibilityProperty: true }) &&
        !e.closest('.sr, .skip, [aria-hidden="true"], option') &&
        getComputedStyle(e).clipPath === 'none';
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) {
      const text = texts.currentNode.data.trim(),
        e = texts.currentNode.parentElement;
      if (text.length < 2 || !seen(e) || e.closest('script, style, select')) continue;
      const range = document.createRange();
      range.selectNodeContents(texts.currentNode);
      const rects = [...range.getClientRects()].filter((r) => r.width > 0),
        lines = new Set(rects.map((r) => Math.round(r.top))).size;
      if (!rects.length) continue;
      // A word stays whole, unless it is longer than a line may be, or has a place to break.
      for (const word of lines > 1 ? texts.currentNode.data.matchAll(/[\p{L}\p{N}]{2,20}/gu) : []) {
        range.setStart(texts.currentNode, word.index);
        range.setEnd(texts.currentNode, word.index + word[0].length);
        const tops = new Set([...range.getClientRects()].filter((r) => r.width > 0).map((r) => Math.round(r.top)));
        if (tops.size > 1) found.push(`broken word ${word[0]}: ${name(e)}`);
      }
      const right = Math.max(...rects.map((r) => r.right)),
        left = Math.min(...rects.map((r) => r.left));
      for (let box = e; box && box !== document.body; box = box.parentElement) {
        const style = getComputedStyle(box),
          b = box.getBoundingClientRect();
        if (/auto|scroll/.test(style.overflowX)) break;
        const hides = /hidden|clip/.test(style.overflowX) || box.tagName === 'svg',
          pressed = box.matches('button, .btn, .tile, .chip');
        if ((hides || pressed) && (right > b.right + 1.5 || left < b.left - 1.5)) {
          if (!(hides && style.textOverflow === 'ellipsis'))
            found.push(`${hides ? 'cut off' : 'out of its button'}: ${name(e)}`);
          else if (!box.title && !e.closest('[title]')) found.push(`shortened with no way to read it: ${name(e)}`);
          break;
        }
      }
    }
    // No control is cut by what holds it, unless it can be scrolled to.
    for (const e of document.querySelectorAll('button, a.btn, select, input')) {
      const b = e.getBoundingClientRect();
      for (let box = e.parentElement; seen(e) && box && box !== document.body; box = box.parentElement) {
        const style = getComputedStyle(box),
          c = box.getBoundingClientRect();
        if (/auto|scroll/.test(`${style.overflowX} ${style.overflowY}`)) break;
        if (/hidden|clip/.test(style.overflow) && (b.bottom > c.bottom + 2 || b.right > c.right + 2))
          found.push(`control cut off: ${e.ariaLabel ?? name(e)}`);
      }
    }
    // Controls of one row: none on top of another.
    const controls = [...document.querySelectorAll('button, a.btn, select, input, textarea, .mapcanvas ~ *')].filter(
        (e) => seen(e) && !/absolute|fixed|sticky/.test(getComputedStyle(e).position),
      ),
      by_parent = Map.groupBy(controls, (e) => e.parentElement);
    for (const row of by_parent.values())
      for (const [i, a] of row.entries())
        for (const b of row.slice(i + 1)) {
          const [p, q] = [a.getBoundingClientRect(), b.getBoundingClientRect()],
            over = Math.min(p.right, q.right) - Math.max(p.left, q.left),
            high = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
          if (over > 3 && high > 3) found.push(`on each other: ${name(a)} and ${name(b)}`);
        }
    return [...new Set(found)];
  });

/** Opened by Enter on its opener, a dialog has the focus; Escape closes it, and the opener, or what is there in its place, has the focus again. */
export async function opensByKeys(page, opener, dialog) {
  const has_focus = (locator) => locator.evaluate((e) => e.contains(document.activeElement)),
    waited = async (what, when) => assert.ok(await until(when, 10_000), what);
  await waited('the opener may be pressed', async () => {
    await opener.focus();
    return has_focus(opener);
  });
  await page.keyboard.press('Enter');
  await dialog.waitFor();
  await waited('the dialog has the focus', () => has_focus(dialog));
  await page.keyboard.press('Escape');
  await dialog.waitFor({ state: 'detached' });
  await waited('the focus is back', () => has_focus(opener));
}
async function until(when, ms) {
  for (const end = Date.now() + ms; Date.now() < end; await new Promise((go) => setTimeout(go, 50)))
    if (await when()) return true;
  return when();
}

/** Text of the first match; empty while there is none. */
export const text = (locator) =>
  locator
    .first()
    .textContent({ timeout: 5000 })
    .then(
      (t) => t ?? '',
      () => '',
    );
