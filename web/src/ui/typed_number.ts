/// What a person typed for a number, with a point or a comma and any minus: null for nothing, NaN for what is no number. No field has
/// type="number": a browser says "" there of a number that it does not read, and "4,5" is shown and means nothing.
export function typed_number(text: string): number | null {
  const plain = text.trim().replace(',', '.').replace(/^[−–]/, '-');
  if (plain === '') return null;
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
}
