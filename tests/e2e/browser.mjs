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

/** A browser context with a profile of its own: {context, page, close()}. `options` go to Playwright's context. */
export async function openBrowser(options = {}) {
  const profile = mkdtempSync(join(tmpdir(), 'anchord-chromium-'));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: chromiumPath,
    headless: true,
    args: flags,
    viewport: { width: 1440, height: 900 },
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
  await page.evaluate(axe);
  const found = await page.evaluate(
    ({ enabled, part }) =>
      globalThis.axe.run(part ?? document, { resultTypes: ['violations'], rules: { 'target-size': { enabled } } }),
    { enabled: sizes, part: within },
  );
  const [page_px, window_px] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  const sideways = page_px > window_px + 1 ? [`wider than its window: ${page_px} px in ${window_px}`] : [];
  return [...found.violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.target.join(' ')).join(', ')}`), ...sideways];
}

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
