// What a process used, from /proc.
import { readFileSync, writeFileSync } from 'node:fs';

/** MiB of a field of status: VmRSS, or VmHWM, its peak. */
export const mib = (pid, field) =>
  Number(new RegExp(`^${field}:\\s+(\\d+) kB`, 'm').exec(readFileSync(`/proc/${pid}/status`, 'utf8'))[1]) / 1024;
/** CPU seconds, user and system. */
export function cpu_s(pid) {
  const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ')[1].split(' ');
  return (Number(fields[11]) + Number(fields[12])) / 100;
}
/** The peak begins anew. */
export const forget_peak = (pid) => writeFileSync(`/proc/${pid}/clear_refs`, '5');
