#include <fmt/format.h>

#include "datasets/project/hash.h"
#include "eval/report/base64.h"
#include "eval/report/document.h"

namespace trigpoint {
namespace {

constexpr std::string_view kStyle = R"css(
:root{--ink:#1d2329;--soft:#5a6570;--line:#d9dee3;--ground:#fff;--panel:#f5f7f9;--accent:#0072b2;--good:#00694d;--bad:#a8420a;--warn:#8a5a00}
*{box-sizing:border-box}
html{scroll-padding-top:3.2rem}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
header,main,footer{max-width:74rem;margin:0 auto;padding:0 1.25rem}
header{padding-top:.9rem}
h1{font-size:1.6rem;line-height:1.2;margin:0 0 .2rem;overflow-wrap:anywhere}
h2{font-size:1.4rem;line-height:1.25;margin:2.6rem 0 .7rem;padding-top:.7rem;border-top:2px solid var(--ink);overflow-wrap:anywhere}
h3{font-size:1.1rem;margin:1.9rem 0 .5rem;overflow-wrap:anywhere}
p{margin:.5rem 0;max-width:46rem;overflow-wrap:anywhere}
a{color:var(--accent)}
.sub{color:var(--soft);margin:0;max-width:none}
/* The first chapter is a screen of its own: little air, sentences over both columns. */
main>h2:first-child{margin-top:0;border-top:0;padding-top:.5rem}main>h2:first-child~p{max-width:none}main>h2:first-child~.columns~p{max-width:46rem}
nav{position:sticky;top:0;z-index:2;background:var(--ground);border-bottom:1px solid var(--line);margin-top:.5rem}
nav div{max-width:74rem;margin:0 auto;padding:.45rem 1.25rem;display:flex;gap:1.1rem;overflow-x:auto;white-space:nowrap;font-size:.92rem}
nav a{text-decoration:none}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(11rem,1fr));gap:.8rem;margin:1rem 0}
.fact{background:var(--panel);border-left:4px solid var(--line);border-radius:3px;padding:.65rem .85rem}
.fact b{display:block;font-size:1.5rem;line-height:1.25;font-weight:650;overflow-wrap:anywhere}
.fact span{display:block;font-size:.85rem;color:var(--soft)}
.fact.good{border-color:#009e73}.fact.warn{border-color:#e69f00}.fact.bad{border-color:#d55e00}
p.good,p.warn,p.bad{border-left:4px solid #009e73;background:var(--panel);padding:.5rem .8rem;border-radius:3px}
p.warn{border-color:#e69f00}p.bad{border-color:#d55e00}
figure{margin:1.1rem 0 1.6rem}
figure>div{overflow-x:auto;border:1px solid var(--line);border-radius:3px;background:#fff}
figure svg{display:block;width:100%;min-width:34rem;max-width:60rem;height:auto;margin:0 auto;padding:.5rem;font-family:inherit}
figure img{display:block;max-width:100%;height:auto;margin:0 auto;cursor:zoom-in}
figure.large img{cursor:zoom-out}
figcaption{font-size:.9rem;color:var(--soft);margin-top:.45rem;max-width:52rem;overflow-wrap:anywhere}
.table{overflow-x:auto;margin:.7rem 0 1.4rem;border:1px solid var(--line);border-radius:3px;max-height:max(40rem,85vh);overflow-y:auto}
caption{caption-side:top;text-align:left;font-size:.9rem;color:var(--soft);padding:.45rem .55rem;overflow-wrap:anywhere}
.columns{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:0 1.6rem;align-items:start}
.columns figure{margin:.3rem 0 .5rem}.columns figure svg{min-width:0;max-height:20rem;padding:.2rem}.columns figcaption{font-size:.78rem;line-height:1.35;margin-top:.2rem}
.columns .facts{margin:.3rem 0 .5rem;gap:.5rem;grid-template-columns:repeat(auto-fit,minmax(10rem,1fr))}.columns .fact{padding:.3rem .6rem}.columns .fact b{font-size:1.2rem}.columns .fact span{font-size:.78rem;line-height:1.35}
.columns h3{margin:.6rem 0 .2rem}.columns p{margin:.2rem 0;font-size:.92rem}
figure.thumb{display:inline-block;vertical-align:top;width:calc(25% - 1.3rem);min-width:13rem;margin:.3rem .8rem .6rem 0}
figure.thumb figcaption{font-size:.8rem}
figure.half{display:inline-block;vertical-align:top;width:calc(50% - 1rem);margin-right:.5rem}figure.half svg{min-width:0}
figure.large{position:fixed;inset:0;z-index:9;margin:0;padding:1rem;width:auto;background:#fff;overflow:auto}
figure.large div{border:0}figure.large img{width:100%;max-height:86vh;object-fit:contain}
table{border-collapse:collapse;font-size:.88rem;width:100%;font-variant-numeric:tabular-nums}
th,td{padding:.32rem .55rem;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
td{min-width:3.2rem;max-width:26rem;overflow-wrap:break-word}
td.long{min-width:15rem}
td:first-child{position:sticky;left:0;background:var(--ground)}
th:first-child{left:0;z-index:2}
th{position:sticky;top:0;background:var(--panel);vertical-align:bottom;z-index:1}
th button{font:inherit;text-align:inherit;font-weight:600;border:0;background:none;padding:0;color:inherit;cursor:pointer}
th button::after{content:"\a0\2195";color:#5a6570}
th[aria-sort=ascending] button::after{content:"\a0\2191";color:var(--ink)}
th[aria-sort=descending] button::after{content:"\a0\2193";color:var(--ink)}
td.good{color:var(--good)}td.warn{color:var(--warn)}td.bad{color:var(--bad);font-weight:600}
tbody tr:hover,tbody tr:hover td:first-child{background:#f5f9fc}
details{margin:.8rem 0;border:1px solid var(--line);border-radius:3px;padding:0 .8rem}
summary{cursor:pointer;padding:.55rem 0;font-weight:600;overflow-wrap:anywhere}
footer{color:var(--soft);font-size:.85rem;padding-top:2rem;padding-bottom:2.5rem}
@media(max-width:60rem){.columns{grid-template-columns:1fr}figure.half{width:100%}}
@media(max-width:40rem){body{font-size:15px}h1{font-size:1.5rem}h2{font-size:1.25rem}header,main,footer,nav div{padding-left:.9rem;padding-right:.9rem}.facts{grid-template-columns:1fr 1fr;gap:.5rem}.fact b{font-size:1.2rem}figure svg{min-width:30rem}details{padding:0 .5rem}}
@media print{nav{display:none}.table{max-height:none;overflow:visible}th,td:first-child{position:static}figure,tr{break-inside:avoid}}
)css";

// Shows a picture that is pressed in its own size, and sorts a table by the column whose header is pressed. Reads the
// page, writes only the order of rows.
constexpr std::string_view kScript = R"js(
document.addEventListener('keydown',function(e){var l=document.querySelector('figure.large');
if(e.key==='Escape'&&l)l.classList.remove('large');
else if(e.key==='Enter'&&e.target.tagName==='IMG')e.target.closest('figure').classList.toggle('large')});
document.addEventListener('click',function(e){
if(e.target.tagName==='IMG'){e.target.closest('figure').classList.toggle('large');return}
var b=e.target.closest&&e.target.closest('th button');if(!b)return;
var th=b.parentNode,t=th.closest('table'),k=th.cellIndex,up=th.getAttribute('aria-sort')!=='ascending';
t.querySelectorAll('th').forEach(function(h){h.removeAttribute('aria-sort')});
th.setAttribute('aria-sort',up?'ascending':'descending');
var key=function(r){var c=r.cells[k],v=c.getAttribute('data-v');if(v!==null)return parseFloat(v);var s=c.textContent.trim();return s===''||s==='-'?null:/^-?[0-9.]+$/.test(s)?parseFloat(s):s};
var rows=Array.prototype.slice.call(t.tBodies[0].rows).map(function(r,i){return{r:r,v:key(r),i:i}});
rows.sort(function(x,y){if(x.v===null||y.v===null)return x.v===y.v?x.i-y.i:x.v===null?1:-1;
var d=typeof x.v==='number'&&typeof y.v==='number'?x.v-y.v:String(x.v).localeCompare(String(y.v),'en',{numeric:true});
return d===0?x.i-y.i:up?d:-d});
rows.forEach(function(x){t.tBodies[0].appendChild(x.r)});
});
)js";

// Columns of numbers are set to the right; .c3 is the third.
constexpr size_t kAlignedColumns = 60;
std::string AlignmentStyle() {
  std::string names;
  for (size_t k = 1; k <= kAlignedColumns; ++k) {
    names += fmt::format("{0}.c{1} td:nth-child({1}),.c{1} th:nth-child({1})", k == 1 ? "" : ",", k);
  }
  return names + "{text-align:right}";
}

const char* ClassOf(Tone tone) {
  switch (tone) {
    case Tone::kPlain: return "";
    case Tone::kGood: return "good";
    case Tone::kWarning: return "warn";
    case Tone::kBad: return "bad";
  }
  return "";
}

// ' class="a b"', nothing without a class.
std::string Classes(const std::string& first, Tone tone) {
  std::string all = first;
  if (const std::string second = ClassOf(tone); !second.empty()) all += (all.empty() ? "" : " ") + second;
  return all.empty() ? "" : " class=\"" + all + "\"";
}

// The hash by which the policy names the one script.
std::string ScriptHash() {
  const std::string hex = Sha256(kScript);
  std::string bytes;
  for (size_t i = 0; i < hex.size(); i += 2) bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return "sha256-" + Base64(bytes);
}

class HtmlWriter {
 public:
  explicit HtmlWriter(std::string* html) : html_(*html) {}

  void operator()(const Heading& h) const {
    html_ += fmt::format("<h{} id=\"{}\">{}</h{}>\n", h.level, h.anchor, Escape(h.text), h.level);
  }
  void operator()(const Paragraph& p) const {
    html_ += "<p" + Classes("", p.tone) + ">" + Linked(p.text, p.anchor) + "</p>\n";
  }
  void operator()(const Facts& facts) const {
    html_ += "<div class=\"facts\">";
    for (const Fact& f : facts.facts) {
      html_ += "<div" + Classes("fact", f.tone) + "><span>" + Linked(f.label, f.anchor) + "</span><b>" +
               Escape(f.value) + "</b><span>" + Escape(f.detail) + "</span></div>";
    }
    html_ += "</div>\n";
  }
  void operator()(const Table& table) const {
    // Closing tags of rows and cells are left out, as HTML allows: large tables are most of a large report.
    std::string numbers;
    for (size_t k = 0; k < table.columns.size() && k < kAlignedColumns; ++k) {
      if (table.columns[k].number) numbers += fmt::format("{}c{}", numbers.empty() ? "" : " ", k + 1);
    }
    html_ += "<div class=\"table\"><table class=\"" + numbers + "\">";
    if (const std::string caption = CaptionOf(table); !caption.empty()) {
      html_ += "<caption>" + Escape(caption) + "</caption>";
    }
    html_ += "<thead><tr>";
    for (const TableColumn& c : table.columns) html_ += "<th scope=col><button>" + Escape(c.name) + "</button>";
    html_ += "</thead><tbody>\n";
    for (const std::vector<TableCell>& row : table.rows) {
      html_ += "<tr>";
      for (size_t k = 0; k < row.size(); ++k) Cell(row[k], k < table.columns.size() ? table.columns[k].missing : "");
      html_ += '\n';
    }
    html_ += "</tbody></table></div>\n";
  }
  void operator()(const Figure& figure) const {
    html_ += figure.thumbnail ? "<figure class=\"thumb\"><div>"
             : figure.half    ? "<figure class=\"half\"><div>"
                              : "<figure><div>";
    if (const auto* drawing = std::get_if<Drawing>(&figure.content)) {
      html_ += SvgOf(*drawing, figure.caption);
    } else {
      const Picture& picture = std::get<Picture>(figure.content);
      html_ += fmt::format("<img tabindex=\"0\" width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/{};base64,",
                           picture.width, picture.height, Escape(figure.caption), picture.jpeg ? "jpeg" : "png");
      html_ += Base64(picture.bytes) + "\">";
    }
    html_ += "</div><figcaption>" + Escape(figure.caption) + "</figcaption></figure>\n";
  }
  void operator()(const FoldBegin& fold) const { html_ += "<details><summary>" + Escape(fold.title) + "</summary>\n"; }
  void operator()(const AppendixBegin&) const {}
  void operator()(const AppendixEnd&) const {}
  void operator()(const FoldEnd&) const { html_ += "</details>\n"; }
  void operator()(const Columns& columns) const {
    html_ += columns == Columns::kBegin  ? "<div class=\"columns\"><div>\n"
             : columns == Columns::kNext ? "</div><div>\n"
                                         : "</div></div>\n";
  }

 private:
  static std::string Linked(const std::string& text, const std::string& anchor) {
    return anchor.empty() ? Escape(text) : "<a href=\"#" + Escape(anchor) + "\">" + Escape(text) + "</a>";
  }
  void Cell(const TableCell& cell, const std::string& missing) const {
    constexpr size_t kLong = 40;  // letters that are not to be squeezed into a narrow column
    html_ += "<td" + Classes(cell.text.size() > kLong ? "long" : "", cell.tone);
    // A number sorts as what it says; anything else brings its value along.
    if (cell.sort && cell.text.find_first_not_of("0123456789.-") != std::string::npos) {
      html_ += fmt::format(" data-v=\"{:.6g}\"", *cell.sort);
    }
    html_ += !cell.text.empty() ? ">" : " title=\"" + Escape(missing.empty() ? "no value" : missing) + "\">-";
    if (!cell.anchor.empty()) {
      html_ += "<a href=\"#" + Escape(cell.anchor) + "\">" + Escape(cell.text) + "</a>";
    } else if (!cell.link.empty()) {
      html_ += "<a href=\"" + Escape(cell.link) + "\">" + Escape(cell.text) + "</a>";
    } else {
      html_ += Escape(cell.text);
    }
  }

  std::string& html_;
};

}  // namespace

std::string HtmlOf(const Document& document) {
  std::string html = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  html +=
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
      "'unsafe-inline'; script-src '" +
      ScriptHash() + "'; base-uri 'none'; form-action 'none'\">\n";
  html += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" + Escape(document.title) +
          "</title>\n<style>";
  html += kStyle;
  html += AlignmentStyle();
  html += "</style>\n</head>\n<body>\n<header><h1>" + Escape(document.title) + "</h1><p class=\"sub\">" +
          Escape(document.subtitle) + "</p></header>\n<nav><div>";
  for (const Block& block : document.blocks) {
    const auto* heading = std::get_if<Heading>(&block);
    if (heading != nullptr && heading->level == 2) {
      html += "<a href=\"#" + heading->anchor + "\">" + Escape(heading->text) + "</a>";
    }
  }
  html += "</div></nav>\n<main>\n";
  const HtmlWriter writer(&html);
  for (const Block& block : document.blocks) std::visit(writer, block);
  html += "</main>\n<footer>" + Escape(document.footer) + "</footer>\n<script>";
  html += kScript;
  html += "</script>\n</body>\n</html>\n";
  return html;
}

}  // namespace trigpoint
