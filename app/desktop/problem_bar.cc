#include "app/desktop/problem_bar.h"

#include <QApplication>
#include <QClipboard>
#include <QHBoxLayout>
#include <QLabel>
#include <QPlainTextEdit>
#include <QPushButton>
#include <QStyle>
#include <QVBoxLayout>

namespace trigpoint {

ProblemBar::ProblemBar(QWidget* parent) : QFrame(parent) {
  setObjectName("problem");
  setFrameShape(QFrame::StyledPanel);
  setAutoFillBackground(true);
  auto* icon = new QLabel;
  icon->setPixmap(style()->standardIcon(QStyle::SP_MessageBoxWarning).pixmap(24, 24));
  sentence_ = new QLabel;
  sentence_->setObjectName("problem.sentence");
  sentence_->setAccessibleName(tr("Problem"));
  sentence_->setWordWrap(true);
  sentence_->setTextInteractionFlags(Qt::TextSelectableByMouse | Qt::TextSelectableByKeyboard);
  more_ = new QPushButton(tr("&Details"));
  more_->setObjectName("problem.details");
  more_->setCheckable(true);
  auto* copy = new QPushButton(tr("C&opy"));
  copy->setObjectName("problem.copy");
  auto* close = new QPushButton(tr("C&lose"));
  close->setObjectName("problem.close");
  details_ = new QPlainTextEdit;
  details_->setObjectName("problem.text");
  details_->setAccessibleName(tr("Details of the problem"));
  details_->setReadOnly(true);
  details_->setMaximumHeight(140);
  details_->hide();
  auto* line = new QHBoxLayout;
  line->addWidget(icon);
  line->addWidget(sentence_, 1);
  line->addWidget(more_);
  line->addWidget(copy);
  line->addWidget(close);
  auto* all = new QVBoxLayout(this);
  all->setContentsMargins(6, 4, 6, 4);
  all->addLayout(line);
  all->addWidget(details_);
  connect(more_, &QPushButton::toggled, details_, &QWidget::setVisible);
  connect(copy, &QPushButton::clicked, this,
          [this] { QApplication::clipboard()->setText(sentence() + "\n" + details_->toPlainText()); });
  connect(close, &QPushButton::clicked, this, &QWidget::hide);
  hide();
}

void ProblemBar::Show(const QString& sentence, const QString& details) {
  // Problems that come together stand together: the first in the sentence, the others in the details.
  if (isVisible() && sentence != this->sentence()) {
    details_->appendPlainText(sentence + (details.isEmpty() ? "" : "\n" + details));
    more_->setText(tr("&Details (%1)").arg(details_->blockCount()));
  } else {
    sentence_->setText(sentence);
    details_->setPlainText(details);
    more_->setText(tr("&Details"));
  }
  show();
}

QString ProblemBar::sentence() const { return sentence_->text(); }

}  // namespace trigpoint
