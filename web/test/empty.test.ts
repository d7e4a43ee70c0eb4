import { describe, expect, it } from 'vitest';
import { Empty, not_loaded_words, NotLoaded } from '../src/ui/empty';

describe('a list without rows', () => {
  it('is empty only where the server has said so', () => {
    expect(Empty({ loaded: true, children: 'No flight is stored.' }).type).toBe('p');
    expect(Empty({ loaded: false, children: 'No flight is stored.' }).type).toBe(NotLoaded);
  });
  it('is not loaded without a connection, nor where no answer came', () => {
    expect(not_loaded_words('lost')).toBe('Not loaded: no connection to the server.');
    expect(not_loaded_words('late', true)).toBe('Not loaded: no connection to the server.');
    expect(not_loaded_words('live', true)).toBe('Not loaded.');
    expect(not_loaded_words('live')).toBe('Loading.');
    expect(not_loaded_words('late')).toBe('Loading.');
  });
});
