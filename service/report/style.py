"""The page's style sheet: one column on a phone, two on a laptop, and never wider than the screen."""

STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0; font: 16px/1.45 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
  color: #222; background: #f4f5f6; overflow-wrap: anywhere; }
header, main { max-width: 1240px; margin: 0 auto; padding: 0 16px; }
header { padding-top: 20px; }
h1 { font-size: 1.5rem; margin: 0; line-height: 1.2; }
header p { margin: 4px 0 16px; color: #555; }
main { display: grid; grid-template-columns: minmax(0, 1fr); gap: 16px; padding-bottom: 32px; }
section { background: #fff; border-radius: 8px; padding: 14px 14px 8px; min-width: 0;
  box-shadow: 0 1px 2px rgb(0 0 0 / 12%); }
h2 { font-size: 1.1rem; margin: 0; }
section p { margin: 2px 0 6px; color: #555; font-size: .92rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 8px; border-bottom: 1px solid #eee; text-align: right; vertical-align: baseline; }
th:first-child { text-align: left; font-weight: 500; padding-left: 0; }
thead th { color: #555; font-weight: 500; }
td small { color: #666; white-space: normal; }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 3px 14px; margin: 14px 0 6px;
  font-size: .92rem; }
dt { color: #555; }
dd { margin: 0; }
.key { display: flex; flex-wrap: wrap; gap: 2px 14px; list-style: none; margin: 0 0 4px; padding: 0;
  font-size: .86rem; }
.key li { display: flex; align-items: center; gap: 6px; }
.key i { flex: none; width: 18px; height: 0; border-top: 3px solid var(--c); }
.key i.dash { border-top-style: dashed; border-top-width: 2px; }
.key i.dot { width: 9px; height: 9px; border: 0; border-radius: 50%; background: var(--c); }
.key i.area { height: 11px; border: 1px solid var(--c); background: color-mix(in srgb, var(--c) 35%, white); }
.key i.cross { border: 0; height: auto; width: auto; }
.key i.cross::before { content: "\\00d7"; color: var(--c); font: 700 18px/1 sans-serif; }
#health .key i.area { background: var(--c); }
@media (min-width: 900px) {
  main { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  .wide { grid-column: 1 / -1; }
}
@media (max-width: 600px) {
  header, main { padding-left: 8px; padding-right: 8px; }
  section { padding: 12px 10px 6px; }
  dl { grid-template-columns: minmax(0, 1fr); gap: 0; }
  dd { margin-bottom: 5px; }
}
"""
