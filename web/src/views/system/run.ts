/// Does something to a device and says what became of it.
export type Run = (what: string, work: () => Promise<unknown>, done: string) => Promise<void>;
