// The data folder of a machine whose power is cut: what power_cut_shim.cpp kept of it.
import { cpSync, chmodSync, mkdirSync, readdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';

export class Disk {
  /** `folder` is ours; the data folder is `data` in it. */
  constructor(folder, shim, seed) {
    this.data = join(folder, 'data');
    this.disk = join(folder, 'disk');
    this.shim = shim;
    this.seed = seed;
  }

  /** The disk holds what the folder holds now; the environment in which a server runs on it. */
  prepare() {
    rmSync(this.disk, { recursive: true, force: true });
    mkdirSync(join(this.disk, 'names'), { recursive: true });
    mkdirSync(this.data, { recursive: true, mode: 0o700 });
    for (const name of readdirSync(this.data)) {
      if (!name.endsWith('-shm'))
        cpSync(join(this.data, name), join(this.disk, 'names', name), { recursive: true, preserveTimestamps: true });
    }
    return {
      LD_PRELOAD: this.shim,
      POWER_CUT_DATA: this.data,
      POWER_CUT_DISK: this.disk,
      POWER_CUT_SEED: String(++this.seed),
    };
  }

  /** The power came back: only what was on the disk is there. The server must be dead by now. */
  cut() {
    rmSync(this.data, { recursive: true, force: true });
    cpSync(join(this.disk, 'names'), this.data, { recursive: true, preserveTimestamps: true });
    chmodSync(this.data, 0o700);
  }
}
