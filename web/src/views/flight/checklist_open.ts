import { signal } from '@preact/signals';

export const checklist_open = signal(false);
