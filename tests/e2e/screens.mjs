// node tests/e2e/screens.mjs FOLDER: one sheet a view for docs/screens, each in three sizes and four themes.
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { openBrowser, openPage } from './browser.mjs';
import { fullServer, sizes, views } from './full_server.mjs';
import { eventually } from './server.mjs';

const themes = ['light', 'dark', 'sun', 'auto'],
  shown = sizes.filter(([name]) => name !== 'laptop'),
  k_tile_px = 180;
const folder = process.argv[2];
if (!folder) {
  console.error('usage: node tests/e2e/screens.mjs FOLDER');
  process.exit(2);
}
mkdirSync(folder, { recursive: true });
const { server } = await fullServer(),
  browser = await openBrowser();
try {
  for (const view of views) {
    const tiles = [];
    for (const theme of themes) {
      const { page, id } = await openPage(browser, server, { hash: `#/${view}`, theme });
      if (theme === 'auto') await page.emulateMedia({ colorScheme: 'dark' });
      await eventually(`${view} is there`, () => id(view).isVisible(), 20_000);
      for (const [, width, height] of shown) {
        await page.setViewportSize({ width, height });
        await page.waitForTimeout(700);
        tiles.push((await page.screenshot()).toString('base64'));
      }
      await page.close();
    }
    const sheet = await browser.context.newPage();
    await sheet.setViewportSize({ width: 1130, height: 400 });
    await sheet.setContent(
      `<body style="margin:8px;background:#888;display:flex;flex-wrap:wrap;gap:8px">${tiles
        .map((t) => `<img height="${k_tile_px * 2}" src="data:image/png;base64,${t}">`)
        .join('')}</body>`,
    );
    await sheet.screenshot({ path: join(folder, `${view}.jpg`), type: 'jpeg', quality: 55, fullPage: true });
    await sheet.close();
  }
} finally {
  await browser.close();
  await server.dispose();
}
