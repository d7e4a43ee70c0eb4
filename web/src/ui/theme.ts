import { computed, effect, signal } from '@preact/signals';

export type Theme = 'auto' | 'light' | 'dark' | 'sun';
export const THEMES: readonly Theme[] = ['auto', 'light', 'dark', 'sun'];
const KEY = 'anchord.theme';
const stored = (): Theme => {
  try {
    const t = new URLSearchParams(location.search).get('theme') ?? localStorage.getItem(KEY);
    return THEMES.includes(t as Theme) ? (t as Theme) : 'auto';
  } catch {
    return 'auto';
  }
};
export const theme = signal<Theme>(stored());
const dark_query = matchMedia('(prefers-color-scheme: dark)');
const system_dark = signal(dark_query.matches);
dark_query.addEventListener('change', (e) => (system_dark.value = e.matches));
/// What is on: auto is resolved here, so that the style sheet knows three grounds and not four.
export const ground = computed(() => (theme.value === 'auto' ? (system_dark.value ? 'dark' : 'light') : theme.value));

effect(() => {
  document.documentElement.dataset.theme = ground.value;
});
export function next_theme(): void {
  theme.value = THEMES[(THEMES.indexOf(theme.value) + 1) % THEMES.length]!;
  try {
    localStorage.setItem(KEY, theme.value);
  } catch {
    /* private window: not remembered */
  }
}
/// Reads a custom property in the theme that is on; for canvases.
export const css = (name: string): string => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
