#include "app/desktop/help_dialog.h"

#include <QAction>
#include <QDialogButtonBox>
#include <QMenu>
#include <QMenuBar>
#include <QTextBrowser>
#include <utility>
#include <vector>

#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

using Rows = std::vector<std::pair<QString, QString>>;

QString TableOf(const QString& title, const Rows& rows) {
  QString html = "<h3>" + title + "</h3><table cellspacing=\"4\">";
  for (const auto& [first, second] : rows) {
    html += QString("<tr><td><b>%1</b>&nbsp;&nbsp;</td><td>%2</td></tr>")
                .arg(first.toHtmlEscaped(), second.toHtmlEscaped());
  }
  return html + "</table>";
}

void AddShortcuts(const QMenu* menu, Rows* rows) {
  for (const QAction* action : menu->actions()) {
    if (action->menu() != nullptr) AddShortcuts(action->menu(), rows);
    if (action->shortcut().isEmpty()) continue;
    rows->emplace_back(action->shortcut().toString(QKeySequence::NativeText),
                       menu->title().remove('&') + ": " + action->text().remove('&').section(':', 0, 0));
  }
}

}  // namespace

HelpDialog::HelpDialog(const QMenuBar* menus, QWidget* parent) : QDialog(parent) {
  setObjectName("help");
  setWindowTitle(tr("Keys and terms"));
  setAttribute(Qt::WA_DeleteOnClose);
  resize(640, 560);
  Rows keys;
  for (const QAction* action : menus->actions()) {
    if (action->menu() != nullptr) AddShortcuts(action->menu(), &keys);
  }
  const Rows views = {
      {tr("Wheel, + and -"), tr("pictures, charts and scene: zoom to the mouse")},
      {tr("Drag, arrow keys"), tr("pictures: move; scene: turn, in the plan move")},
      {"0, 1", tr("pictures: fit; pixel by pixel")},
      {tr("Home, F"), tr("scene: all; the selection")},
      {tr("Shift with T, N, E, S, W"), tr("scene: look from above, north, east, south, west, as by the cube")},
      {tr("Page Up, Page Down, Escape"), tr("inside a panorama: the run's others; leave")},
      {"Ctrl+C", tr("scene: copy the coordinates under the mouse; tables: copy the rows")},
      {tr("Ctrl+N"), tr("images: the next image of the selected tag")},
      {tr("Right click"), tr("any station, tag, image, detection, panorama, point: show it, exclude it, restore it")},
      {tr("Double click, Enter"), tr("show it: the image that sees it best")}};
  const Rows terms = {
      {tr("station"), tr("a place with a tag and a panorama, whose position is known or surveyed")},
      {tr("panorama (G2)"), tr("one pose for a whole panorama: the final answer")},
      {tr("view (G1)"), tr("one pose for each rectilinear view of a panorama by itself")},
      {tr("relative"), tr("compared in the run's own frame, with tags that the same cameras saw")},
      {tr("absolute"), tr("compared in site coordinates: the georeference's error is part of it")},
      {"dE, dN, dU", tr("answer minus reference, east, north, up")},
      {QString::fromUtf8("\xcf\x83"), tr("1 sigma, of the difference where an error stands beside it")},
      {"NEES",
       tr("squared error in units of its own covariance; by degree of freedom about 1 if the sigmas are right")},
      {tr("within"), tr("the narrowest tolerance of 0.1, 0.25, 0.5 and 1 m that holds the error; the colours show it")},
      {tr("control, check"), tr("a surveyed point that the map is fitted to; one that only tests it")},
      {tr("detection"), tr("one tag found in one image; its residual is the distance of its corners from the map's")},
      {tr("track"), tr("a point of the scene as several images see it; lines show reprojection errors ten times as "
                       "long")},
      {tr("reference trajectory"), tr("poses of every image by tag map and odometry, against which cameras are held")},
      {tr("variant"), tr("a second set of results beside the first, with other options")},
      {tr("release"), tr("a frozen copy of results with all they rest on")}};
  auto* text = Named(new QTextBrowser, "help.text", windowTitle());
  text->setHtml(TableOf(tr("Keys of the menus"), keys) + TableOf(tr("Keys and mouse in the views"), views) +
                TableOf(tr("Terms"), terms));
  auto* buttons = new QDialogButtonBox(QDialogButtonBox::Close);
  connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::close);
  InColumn({{text, 1}, buttons}, this);
}

}  // namespace trigpoint
