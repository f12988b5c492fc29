#include "app/desktop/problem_bar.h"

#include <QApplication>
#include <QClipboard>
#include <QEvent>
#include <QLabel>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QStyle>
#include <algorithm>

#include "app/desktop/widgets.h"

namespace trigpoint {

namespace {

constexpr int kDetailsHeight = 160;

}  // namespace

ProblemBar::ProblemBar(QWidget* parent) : QFrame(parent) {
  setObjectName("problem");
  auto* icon = new QLabel;
  icon->setPixmap(style()->standardIcon(QStyle::SP_MessageBoxWarning).pixmap(20, 20));
  label_ = Named(new QLabel, "problem.sentence", tr("Problem"));
  label_->setTextInteractionFlags(Qt::TextSelectableByMouse | Qt::TextSelectableByKeyboard);
  label_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  QFont bold = label_->font();
  bold.setBold(true);
  label_->setFont(bold);
  more_ = MakeButton("problem.details", tr("&Details"));
  more_->setCheckable(true);
  auto* copy = MakeButton("problem.copy", tr("C&opy"));
  auto* close = MakeButton("problem.close", tr("D&ismiss"));
  details_ = ReadOnly(Named(new QPlainTextEdit(this), "problem.text", tr("Details of the problem")));
  details_->hide();
  InRow({icon, {label_, 1}, more_, copy, close}, this)->setContentsMargins(2, 0, 2, 0);
  connect(more_, &QPushButton::toggled, this, [this](bool on) {
    if (!details_) return;  // the window goes
    PlaceDetails();
    details_->setVisible(on);
  });
  connect(copy, &QPushButton::clicked, this, [this] { QApplication::clipboard()->setText(details_->toPlainText()); });
  connect(close, &QPushButton::clicked, this, &QWidget::hide);
  hide();
}

void ProblemBar::Show(const QString& sentence, const QString& details) {
  const QString text = details.isEmpty() ? sentence : sentence + "\n" + details;
  // Of problems that come together the first stands in the sentence, all in the details.
  if (isVisible() && sentence != sentence_) {
    details_->appendPlainText(text);
  } else {
    sentence_ = sentence;
    details_->setPlainText(text);
  }
  more_->setText(details_->blockCount() > 1 ? tr("&Details (%1)").arg(details_->blockCount()) : tr("&Details"));
  ShowSentence();
  show();
}

void ProblemBar::ShowSentence() {
  label_->setText(label_->fontMetrics().elidedText(sentence_.simplified(), Qt::ElideRight, label_->width()));
  label_->setToolTip(sentence_);
  label_->setAccessibleDescription(sentence_);
}

void ProblemBar::PlaceDetails() {
  if (details_->parentWidget() != window()) {
    details_->setParent(window());
    window()->installEventFilter(this);
  }
  const int bottom = mapTo(window(), QPoint(0, 0)).y();
  const int height = std::min(kDetailsHeight, bottom / 2);
  details_->setGeometry(0, bottom - height, window()->width(), height);
  details_->raise();
}

void ProblemBar::resizeEvent(QResizeEvent* event) {
  QFrame::resizeEvent(event);
  ShowSentence();
}

void ProblemBar::hideEvent(QHideEvent* event) {
  QFrame::hideEvent(event);
  more_->setChecked(false);
}

bool ProblemBar::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::Resize && details_ && details_->isVisible()) PlaceDetails();
  return QFrame::eventFilter(watched, event);
}

}  // namespace trigpoint
