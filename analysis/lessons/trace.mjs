// Plays requests through the native walker.
import { execFileSync } from "node:child_process";

/// Returns the traces of `requests` (see walker/walker.cpp).
export function walk(program, requests) {
  return JSON.parse(
    execFileSync(program, { input: JSON.stringify(requests), maxBuffer: 1 << 30, stdio: ["pipe", "pipe", "inherit"] }));
}
